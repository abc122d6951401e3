//! What an experiment comes back with: figures, tables, and what became of the paper's claims.

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::figure::Figure;
use super::name::ExperimentName;

/// All that one experiment has found.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Which experiment.
    pub name: ExperimentName,
    /// What was done, in a few sentences.
    pub method: String,
    /// The paper's claims beside what came out.
    pub claims: Vec<Claim>,
    /// Numbers.
    pub tables: Vec<Table>,
    /// Pictures.
    pub figures: Vec<Figure>,
}

/// One statement of the paper, or of ours, and what came out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Claim {
    /// What is claimed.
    pub claim: String,
    /// The paper's number or words.
    pub paper: String,
    /// What was measured here.
    pub ours: String,
    /// Whether it holds.
    pub verdict: Verdict,
}

/// Whether a claim holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// As claimed.
    Holds,
    /// Under conditions that the measured text names.
    InPart,
    /// Not here.
    Fails,
}

impl Verdict {
    /// `Holds` when so, else `Fails`.
    #[must_use]
    pub fn when(so: bool) -> Self {
        if so { Self::Holds } else { Self::Fails }
    }

    /// For people.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::InPart => "holds in part",
            Self::Fails => "does not hold",
        }
    }
}

/// Rows of numbers and words.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Stem of its files.
    pub name: String,
    /// What it shows.
    pub caption: String,
    /// Names of the columns, with units.
    pub columns: Vec<String>,
    /// As many cells as columns each.
    pub rows: Vec<Vec<Cell>>,
}

/// One entry of a table.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// Words.
    Text(String),
    /// A number, shown with three decimals.
    Number(f64),
    /// A whole number.
    Count(usize),
    /// Yes or no.
    Flag(bool),
    /// Nothing was measured.
    Nothing,
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<f64> for Cell {
    fn from(number: f64) -> Self {
        if number.is_finite() {
            Self::Number(number)
        } else {
            Self::Nothing
        }
    }
}

impl From<usize> for Cell {
    fn from(count: usize) -> Self {
        Self::Count(count)
    }
}

impl From<bool> for Cell {
    fn from(flag: bool) -> Self {
        Self::Flag(flag)
    }
}

impl<T: Into<Cell>> From<Option<T>> for Cell {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Nothing, Into::into)
    }
}

impl Cell {
    /// For people.
    #[must_use]
    pub fn shown(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Number(number) => format!("{number:.3}"),
            Self::Count(count) => count.to_string(),
            Self::Flag(flag) => if *flag { "yes" } else { "no" }.to_owned(),
            Self::Nothing => "-".to_owned(),
        }
    }

    /// Whether it is told in figures.
    #[must_use]
    pub fn is_number(&self) -> bool {
        matches!(self, Self::Number(_) | Self::Count(_))
    }

    fn json(&self) -> Value {
        match self {
            Self::Text(text) => json!(text),
            Self::Number(number) => json!(number),
            Self::Count(count) => json!(count),
            Self::Flag(flag) => json!(flag),
            Self::Nothing => Value::Null,
        }
    }
}

impl Table {
    /// A table without rows.
    #[must_use]
    pub fn new(name: impl Into<String>, caption: impl Into<String>, columns: &[&str]) -> Self {
        Self {
            name: name.into(),
            caption: caption.into(),
            columns: columns.iter().map(|column| (*column).to_owned()).collect(),
            rows: Vec::new(),
        }
    }

    /// Adds a row.
    ///
    /// # Panics
    /// When it has not as many cells as there are columns.
    pub fn push(&mut self, row: Vec<Cell>) {
        assert_eq!(row.len(), self.columns.len(), "invariant: a cell a column");
        self.rows.push(row);
    }

    /// Comma-separated values (RFC 4180), a header line first; an empty field where nothing was measured.
    #[must_use]
    pub fn csv(&self) -> String {
        let quoted = |text: &str| {
            if text.contains([',', '"', '\n']) {
                format!("\"{}\"", text.replace('"', "\"\""))
            } else {
                text.to_owned()
            }
        };
        let field = |cell: &Cell| match cell {
            Cell::Number(number) => number.to_string(),
            Cell::Nothing => String::new(),
            other => quoted(&other.shown()),
        };
        let header = self.columns.iter().map(|column| quoted(column)).collect::<Vec<_>>();
        let mut lines = vec![header.join(",")];
        lines.extend(
            self.rows
                .iter()
                .map(|row| row.iter().map(field).collect::<Vec<_>>().join(",")),
        );
        lines.join("\r\n") + "\r\n"
    }

    fn json(&self) -> Value {
        let row = |row: &Vec<Cell>| {
            let cells = self.columns.iter().cloned().zip(row.iter().map(Cell::json));
            Value::Object(cells.collect::<Map<_, _>>())
        };
        Value::Array(self.rows.iter().map(row).collect())
    }
}

impl Outcome {
    /// Everything but the pictures, as JSON.
    #[must_use]
    pub fn json(&self) -> Value {
        let tables: Map<_, _> = self
            .tables
            .iter()
            .map(|table| (table.name.clone(), table.json()))
            .collect();
        json!({
            "experiment": self.name.as_str(),
            "method": self.method,
            "claims": self.claims,
            "tables": tables,
            "figures": self.figures.iter().map(|figure| &figure.name).collect::<Vec<_>>(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_with_commas_and_quotes_are_quoted_and_nothing_is_empty() {
        let mut table = Table::new("t", "a table", &["name", "length [m]"]);
        table.push(vec!["a, \"b\"".into(), 0.25.into()]);
        table.push(vec!["c".into(), f64::NAN.into()]);
        assert_eq!(table.csv(), "name,length [m]\r\n\"a, \"\"b\"\"\",0.25\r\nc,\r\n");
        assert_eq!(
            table.json(),
            json!([{"name": "a, \"b\"", "length [m]": 0.25}, {"name": "c", "length [m]": null}])
        );
    }
}
