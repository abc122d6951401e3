//! The choice of a method by name, with its parameters.

use std::sync::Arc;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;
use utoipa::openapi::{RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

use super::hough::{Hough, HoughParameters, HoughParametersError};
use super::parameter::{self, ParameterError};
use super::{
    FourierHough, FourierHoughParams, HoughPeaks, HoughPeaksParams, HoughSpectrum, HoughSpectrumParams,
    MapSegmentation, MapSegmentationParams, Method, MethodName, RandomWalk, RandomWalkParams, Ransac, RansacParams,
};

/// A method with parameters that were checked: `{"name": "hough-peaks", "parameters": {"v_gate": 12}}`.
///
/// Parameters that are not named have their defaults. Serialised with all of them, so that the text tells what ran.
///
/// ```
/// use mapweld::registration::MethodSpec;
/// let spec: MethodSpec = serde_json::from_str(r#"{"name": "hough-peaks", "parameters": {"v_gate": 12}}"#)?;
/// assert_eq!(spec.parameters()["v_gate"], 12.0);
/// assert_eq!(spec.parameters()["d_gate"], 30.0);
/// assert!(serde_json::from_str::<MethodSpec>(r#"{"name": "hough-peaks", "parameters": {"v_gate": -1}}"#).is_err());
/// # Ok::<(), serde_json::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Fields", into = "Fields")]
pub struct MethodSpec {
    choice: Choice,
}

/// Every method with its parameters, which were checked.
#[derive(Debug, Clone, PartialEq)]
enum Choice {
    Hough(HoughParameters),
    HoughPeaks(HoughPeaksParams),
    HoughSpectrum(HoughSpectrumParams),
    FourierHough(FourierHoughParams),
    RandomWalk(RandomWalkParams),
    MapSegmentation(MapSegmentationParams),
    Ransac(RansacParams),
}

/// How a [`MethodSpec`] is written.
#[derive(Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct Fields {
    /// The method.
    name: MethodName,
    /// Its parameters by name; those that are not named have their defaults.
    #[serde(default)]
    #[schema(value_type = Option<Object>)]
    parameters: Option<Value>,
}

impl PartialSchema for MethodSpec {
    fn schema() -> RefOr<Schema> {
        Fields::schema()
    }
}

impl ToSchema for MethodSpec {
    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        Fields::schemas(schemas);
    }
}

/// Why there is no such method.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MethodError {
    /// The parameters cannot be read, or one of a method other than `hough` is out of range.
    #[error("method {method}: {problem}")]
    Parameters {
        /// The method that was asked for.
        method: MethodName,
        /// What is wrong with its parameters.
        #[source]
        problem: ParameterError,
    },
    /// A parameter of `hough` is out of range.
    #[error(transparent)]
    Hough(#[from] HoughParametersError),
}

impl MethodSpec {
    /// The method of this name with these parameters, a JSON object; none, or null, for all defaults.
    ///
    /// # Errors
    /// [`MethodError`] names the method, the parameter, its value and its limits.
    pub fn new(name: MethodName, parameters: Option<Value>) -> Result<Self, MethodError> {
        let in_method = |problem| MethodError::Parameters { method: name, problem };
        let choice = match name {
            MethodName::Hough => {
                let parameters: HoughParameters = parameter::parse(parameters).map_err(in_method)?;
                Choice::Hough(parameters.checked()?)
            }
            MethodName::HoughPeaks => {
                let params = parameter::parse(parameters).and_then(HoughPeaksParams::checked);
                Choice::HoughPeaks(params.map_err(in_method)?)
            }
            MethodName::HoughSpectrum => Choice::HoughSpectrum(
                parameter::parse_checked(parameters, HoughSpectrumParams::validate).map_err(in_method)?,
            ),
            MethodName::FourierHough => Choice::FourierHough(
                parameter::parse_checked(parameters, FourierHoughParams::validate).map_err(in_method)?,
            ),
            MethodName::RandomWalk => {
                Choice::RandomWalk(parameter::parse_checked(parameters, RandomWalkParams::validate).map_err(in_method)?)
            }
            MethodName::MapSegmentation => Choice::MapSegmentation(
                parameter::parse_checked(parameters, MapSegmentationParams::validate).map_err(in_method)?,
            ),
            MethodName::Ransac => {
                Choice::Ransac(parameter::parse_checked(parameters, RansacParams::validate).map_err(in_method)?)
            }
        };
        Ok(Self { choice })
    }

    /// Brings what an earlier release wrote down of a method up to date, in place. Only for records: callers are told of
    /// parameters that do not exist.
    ///
    /// Release 0.1.0 decided by three rules of thumb, whose bounds (`decision.plain` and others) mean nothing to the
    /// probability that has replaced them: its decision takes the defaults of today.
    pub fn renew(record: &mut Value) {
        let Some(parameters) = record.get_mut("parameters").and_then(Value::as_object_mut) else {
            return;
        };
        if parameters
            .get("decision")
            .is_some_and(|decision| decision.get("plain").is_some())
        {
            parameters.remove("decision");
        }
    }

    /// Reads a record, whichever release wrote it.
    ///
    /// # Errors
    /// When it is no method.
    pub fn deserialize_record<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut record = Value::deserialize(deserializer)?;
        Self::renew(&mut record);
        Self::deserialize(record).map_err(D::Error::custom)
    }

    /// The method of this name with all parameters at their defaults.
    ///
    /// # Panics
    /// Never: every default is within its range.
    #[must_use]
    pub fn default_of(name: MethodName) -> Self {
        Self::new(name, None).expect("invariant: every default is within its range")
    }

    /// The method's name.
    #[must_use]
    pub fn name(&self) -> MethodName {
        match self.choice {
            Choice::Hough(_) => MethodName::Hough,
            Choice::HoughPeaks(_) => MethodName::HoughPeaks,
            Choice::HoughSpectrum(_) => MethodName::HoughSpectrum,
            Choice::FourierHough(_) => MethodName::FourierHough,
            Choice::RandomWalk(_) => MethodName::RandomWalk,
            Choice::MapSegmentation(_) => MethodName::MapSegmentation,
            Choice::Ransac(_) => MethodName::Ransac,
        }
    }

    /// All its parameters, those at their defaults as well, as a JSON object.
    ///
    /// # Panics
    /// Never: parameters are numbers and names.
    #[must_use]
    pub fn parameters(&self) -> Value {
        let object = match &self.choice {
            Choice::Hough(parameters) => serde_json::to_value(parameters),
            Choice::HoughPeaks(params) => serde_json::to_value(params),
            Choice::HoughSpectrum(params) => serde_json::to_value(params),
            Choice::FourierHough(params) => serde_json::to_value(params),
            Choice::RandomWalk(params) => serde_json::to_value(params),
            Choice::MapSegmentation(params) => serde_json::to_value(params),
            Choice::Ransac(params) => serde_json::to_value(params),
        };
        object.expect("invariant: parameters are numbers and names")
    }

    /// The method, ready to register. It may hold what it has computed for itself, so build it once for many pairs.
    ///
    /// # Panics
    /// Never: the parameters were checked.
    #[must_use]
    pub fn build(&self) -> Arc<dyn Method> {
        const CHECKED: &str = "invariant: the parameters of a spec were checked";
        match &self.choice {
            Choice::Hough(parameters) => Arc::new(Hough::new(parameters.clone()).expect(CHECKED)),
            Choice::HoughPeaks(params) => Arc::new(HoughPeaks::new(params.clone()).expect(CHECKED)),
            Choice::HoughSpectrum(params) => Arc::new(HoughSpectrum::new(params.clone()).expect(CHECKED)),
            Choice::FourierHough(params) => Arc::new(FourierHough::new(params.clone()).expect(CHECKED)),
            Choice::RandomWalk(params) => Arc::new(RandomWalk::new(params.clone()).expect(CHECKED)),
            Choice::MapSegmentation(params) => Arc::new(MapSegmentation::new(params.clone()).expect(CHECKED)),
            Choice::Ransac(params) => Arc::new(Ransac::new(params.clone()).expect(CHECKED)),
        }
    }
}

impl Default for MethodSpec {
    /// The default method with its defaults.
    fn default() -> Self {
        Self::default_of(MethodName::ALL[0])
    }
}

impl TryFrom<Fields> for MethodSpec {
    type Error = MethodError;
    fn try_from(fields: Fields) -> Result<Self, MethodError> {
        Self::new(fields.name, fields.parameters)
    }
}

impl From<MethodSpec> for Fields {
    fn from(spec: MethodSpec) -> Self {
        Self {
            name: spec.name(),
            parameters: Some(spec.parameters()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn every_method_is_built_by_its_name_and_echoes_all_its_parameters() {
        for name in MethodName::ALL {
            let spec = MethodSpec::default_of(name);
            assert_eq!((spec.name(), spec.build().name()), (name, name));
            assert_eq!(MethodSpec::new(name, Some(spec.parameters())), Ok(spec.clone()));
            let text = serde_json::to_string(&spec).expect("a spec serialises");
            assert_eq!(serde_json::from_str::<MethodSpec>(&text).expect("and parses"), spec);
        }
    }

    #[test]
    fn what_an_earlier_release_wrote_down_is_read_and_callers_are_still_refused() {
        let old = json!({"name": "hough", "parameters": {"rotations": 7, "decision": {"plain": {"score_min": 30.0}}}});
        assert!(serde_json::from_value::<MethodSpec>(old.clone()).is_err());
        let spec = MethodSpec::deserialize_record(old).expect("a record");
        let asked = MethodSpec::new(MethodName::Hough, Some(json!({"rotations": 7})));
        assert_eq!(Ok(spec.clone()), asked);
        let now = serde_json::to_value(&spec).expect("serialises");
        assert_eq!(MethodSpec::deserialize_record(now).expect("a record"), spec);
    }

    #[test]
    fn parameters_that_are_not_named_have_their_defaults() {
        let spec: MethodSpec = serde_json::from_value(json!({"name": "hough-peaks"})).expect("all defaults");
        assert_eq!(spec, MethodSpec::default_of(MethodName::HoughPeaks));
        let parameters = json!({"v_gate": 12, "spectrum": "entropy"});
        let spec = MethodSpec::new(MethodName::HoughPeaks, Some(parameters)).expect("two named");
        assert_eq!(spec.parameters()["v_gate"], json!(12.0));
        assert_eq!(spec.parameters()["spectrum"], json!("entropy"));
    }

    #[test]
    fn a_refusal_names_the_method_the_parameter_its_value_and_the_limits() {
        let refused = |parameters| {
            let refusal = MethodSpec::new(MethodName::HoughPeaks, Some(parameters)).expect_err("out of range");
            refusal.to_string()
        };
        let range = refused(json!({"overlap_min": 1.5}));
        assert_eq!(
            range,
            "method hough-peaks: parameter \"overlap_min\" is 1.5; it must lie within 0 and 1 (a share)"
        );
        let kind = refused(json!({"d_gate": 3, "v_gate": "ten"}));
        assert!(
            kind.contains("parameter \"v_gate\" is \"ten\"") && kind.contains("f64"),
            "{kind}"
        );
        let unknown = refused(json!({"v_gat": 10}));
        assert!(unknown.contains("v_gat") && unknown.contains("`v_gate`"), "{unknown}");
        assert!(refused(json!([1])).contains("JSON object"));
        let hough = MethodSpec::new(MethodName::Hough, Some(json!({"rotations": 99}))).expect_err("too many");
        assert!(
            hough.to_string().contains("rotations") && hough.to_string().contains("99"),
            "{hough}"
        );
        let method = serde_json::from_value::<MethodSpec>(json!({"name": "magic"})).expect_err("no such method");
        assert!(method.to_string().contains("hough-peaks"), "{method}");
    }
}
