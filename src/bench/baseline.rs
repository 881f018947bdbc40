//! An earlier result beside this one: what is slower now, beyond what the machine's own pace and noise explain.

use super::BenchError;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

/// A column whose times are so many times as long, all of its rows together, is slower.
const COLUMN: f64 = 1.25;
/// A single row: so many times, and no run of it as fast as the slowest before.
const ROW: f64 = 1.6;

/// Something that takes longer than it did.
#[derive(Clone, Debug, PartialEq)]
pub struct Slower {
    /// The workload.
    pub workload: String,
    /// The table, the column, and the row where it is one alone.
    pub what: String,
    /// How many times as long, the machine's pace counted in.
    pub times: f64,
}

impl fmt::Display for Slower {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} is slower: {:.2} times as long", self.workload, self.what, self.times)
    }
}

/// An earlier result.
pub(super) struct Baseline(Value);

/// A figure of several runs.
#[derive(Clone, Copy)]
struct Figure {
    median: f64,
    least: f64,
    greatest: f64,
}

impl Baseline {
    pub(super) fn read(path: &Path) -> Result<Self, BenchError> {
        let bad = |why: String| BenchError::Baseline(path.display().to_string(), why);
        let bytes = std::fs::read(path).map_err(|e| bad(e.to_string()))?;
        let json: Value = serde_json::from_slice(&bytes).map_err(|e| bad(e.to_string()))?;
        if json["workload"].is_string() { Ok(Self(json)) } else { Err(bad("it is no result".to_string())) }
    }

    pub(super) fn is_of(&self, workload: &str) -> bool {
        self.0["workload"] == workload
    }

    /// What of a result is slower than in this one.
    pub(super) fn slower(&self, now: &Value) -> Vec<Slower> {
        let pace = |result: &Value| result["pace_ms"].as_f64().filter(|ms| *ms > 0.0);
        // a machine that is slower now explains longer times; one that is faster accuses nobody
        let pace = pace(now).zip(pace(&self.0)).map_or(1.0, |(now, then)| (now / then).max(1.0));
        let workload = now["workload"].as_str().unwrap_or_default().to_string();
        let (then, now) = (figures(&self.0), figures(now));
        let mut slower = Vec::new();
        for (column, rows) in &now {
            let Some(before) = then.get(column) else { continue };
            let both: Vec<(&String, Figure, Figure)> =
                rows.iter().filter_map(|(row, now)| Some((row, *now, *before.get(row)?))).collect();
            let times = |now: &Figure, then: &Figure| now.median / then.median / pace;
            let logs: f64 = both.iter().map(|(_, now, then)| times(now, then).ln()).sum();
            let all = (logs / both.len().max(1) as f64).exp();
            let tell = |what: String, times: f64| Slower { workload: workload.clone(), what, times };
            if all > COLUMN {
                slower.push(tell(column.clone(), all));
                continue;
            }
            let is_slower = |(_, now, then): &&(&String, Figure, Figure)| {
                times(now, then) > ROW && now.least > then.greatest * pace
            };
            let single = both.iter().filter(is_slower);
            slower.extend(single.map(|(row, now, then)| tell(format!("{column}, {row}"), times(now, then))));
        }
        slower
    }
}

/// What was measured in milliseconds, several times, by table and column, then by row.
fn figures(result: &Value) -> BTreeMap<String, BTreeMap<String, Figure>> {
    let mut figures: BTreeMap<String, BTreeMap<String, Figure>> = BTreeMap::new();
    for table in result["tables"].as_array().into_iter().flatten() {
        let name = table["name"].as_str().unwrap_or_default();
        let columns: Vec<&str> =
            table["columns"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
        for row in table["rows"].as_array().into_iter().flatten() {
            let cells = row[1].as_array().into_iter().flatten();
            for (column, cell) in
                columns.iter().zip(cells).filter(|(column, _)| column.trim_end().ends_with("ms"))
            {
                let number = |key: &str| cell[key].as_f64().filter(|x| *x > 0.0);
                if let (Some(median), Some(least), Some(greatest)) =
                    (number("median"), number("least"), number("greatest"))
                {
                    let row = row[0].as_str().unwrap_or_default().to_string();
                    let rows = figures.entry(format!("{name}: {}", column.trim_end())).or_default();
                    rows.insert(row, Figure { median, least, greatest });
                }
            }
        }
    }
    figures
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A result with one table of two rows, of which the second's time is given.
    fn result(pace_ms: f64, medians: [f64; 2]) -> Value {
        let cell = |m: f64| serde_json::json!({"median": m, "least": 0.9 * m, "greatest": 1.1 * m});
        serde_json::json!({
            "workload": "w", "pace_ms": pace_ms,
            "tables": [{"name": "t", "columns": ["a, ms", "MB"], "rows":
                [["x", [cell(medians[0]), 5.0]], ["y", [cell(medians[1]), 7.0]]]}],
        })
    }

    fn told(then: Value, now: &Value) -> Vec<String> {
        Baseline(then).slower(now).iter().map(ToString::to_string).collect()
    }

    #[test]
    fn what_is_slower_is_named_and_noise_is_not() {
        let then = || result(10.0, [10.0, 100.0]);
        assert!(told(then(), &then()).is_empty());
        assert!(told(then(), &result(10.0, [11.0, 115.0])).is_empty(), "noise");
        assert!(told(then(), &result(10.0, [5.0, 50.0])).is_empty(), "faster");
        assert_eq!(told(then(), &result(10.0, [15.0, 150.0])), ["w: t: a, ms is slower: 1.50 times as long"]);
        // a machine that is half as fast explains twice the time
        assert!(told(then(), &result(20.0, [20.0, 200.0])).is_empty());
        assert_eq!(told(then(), &result(20.0, [40.0, 400.0])).len(), 1);
        assert!(told(then(), &result(5.0, [11.0, 110.0])).is_empty(), "a faster machine accuses nobody");
        // one row alone, by more: √1.7 is below the column's bar, were it not so many others'
        let one = |now: f64| {
            let many = |y: f64| {
                let mut result = result(10.0, [10.0, y]);
                let rows = result["tables"][0]["rows"].as_array_mut().unwrap();
                (0..8).for_each(|i| rows.push(serde_json::json!([format!("z{i}"), rows[0][1]])));
                result
            };
            told(many(100.0), &many(now))
        };
        assert_eq!(one(170.0), ["w: t: a, ms, y is slower: 1.70 times as long"]);
        assert!(one(130.0).is_empty());
    }
}
