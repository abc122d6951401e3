//! What can be wrong with a method's parameters, told by name, value and limit.

use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

/// A parameter that is refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ParameterError {
    /// Not within its range.
    #[error("parameter {field:?} is {value}; it must lie within {min} and {max} {unit}")]
    OutOfRange {
        /// Name of the parameter.
        field: &'static str,
        /// What it was set to.
        value: f64,
        /// The least it may be.
        min: f64,
        /// The most it may be.
        max: f64,
        /// Unit of all three.
        unit: &'static str,
    },
    /// An even number where there must be a middle.
    #[error("parameter {field:?} is {value}; it must be odd")]
    Even {
        /// Name of the parameter.
        field: &'static str,
        /// What it was set to.
        value: u32,
    },
    /// No such parameter, or a value of the wrong kind.
    #[error("parameter {field:?} is {value}: {problem}")]
    Malformed {
        /// Name of the parameter.
        field: String,
        /// What it was set to, as JSON.
        value: String,
        /// What is wrong with it.
        problem: String,
    },
    /// The parameters are no JSON object at all.
    #[error("the parameters must be a JSON object like {{\"v_gate\": 12}}, not {0}")]
    NotAnObject(String),
}

impl ParameterError {
    /// Refuses a value outside of `min..=max`, and one that is not a number.
    pub(super) fn check(field: &'static str, value: f64, min: f64, max: f64, unit: &'static str) -> Result<(), Self> {
        if (min..=max).contains(&value) {
            return Ok(());
        }
        Err(Self::OutOfRange {
            field,
            value,
            min,
            max,
            unit,
        })
    }
}

/// As [`parse`], and within their ranges.
pub(super) fn parse_checked<P: DeserializeOwned + Default>(
    parameters: Option<Value>,
    validate: impl Fn(&P) -> Result<(), ParameterError>,
) -> Result<P, ParameterError> {
    let parameters = parse(parameters)?;
    validate(&parameters).map(|()| parameters)
}

/// The parameters that a JSON object names, all others at their defaults; `None` and null name none.
pub(super) fn parse<P: DeserializeOwned + Default>(parameters: Option<Value>) -> Result<P, ParameterError> {
    let fields = match parameters {
        None | Some(Value::Null) => return Ok(P::default()),
        Some(Value::Object(fields)) => fields,
        Some(other) => return Err(ParameterError::NotAnObject(other.to_string())),
    };
    serde_json::from_value(Value::Object(fields.clone())).map_err(|whole| {
        // serde tells what is wrong but not where: the culprit is the field that fails alone
        let culprit = fields.into_iter().find_map(|(field, value)| {
            let alone = Map::from_iter([(field.clone(), value.clone())]);
            let problem = serde_json::from_value::<P>(Value::Object(alone)).err()?.to_string();
            Some(ParameterError::Malformed {
                field,
                value: value.to_string(),
                problem,
            })
        });
        culprit.unwrap_or_else(|| ParameterError::NotAnObject(whole.to_string()))
    })
}
