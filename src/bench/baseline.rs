//! An earlier result beside this one: what is slower now, beyond what the machine's own pace and noise explain. Compared are
//! this program's times; other programs' are not, nor rates, nor what is simulated.

use super::{BenchError, Workload};
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

/// Whose columns are not this program's.
const PEERS: [&str; 4] = ["tobj", "Embree", "Mitsuba", "thesis"];

/// An earlier result.
pub(super) struct Baseline {
    file: String,
    json: Value,
}

/// A figure of several runs.
#[derive(Clone, Copy)]
struct Figure {
    median: f64,
    least: f64,
    greatest: f64,
}

impl Baseline {
    /// Reads a result that can be compared with one of these workloads with these settings.
    pub(super) fn read(path: &Path, settings: &Value, workloads: &[Workload]) -> Result<Self, BenchError> {
        let file = path.display().to_string();
        let bad = |why: String| BenchError::Baseline(file.clone(), why);
        let bytes = std::fs::read(path).map_err(|e| bad(e.to_string()))?;
        let json: Value = serde_json::from_slice(&bytes).map_err(|e| bad(e.to_string()))?;
        let Some(workload) = json["workload"].as_str() else {
            return Err(bad("it is no result".to_string()));
        };
        if !workloads.iter().any(|w| w.name == workload) {
            return Err(bad(format!("it is of {workload}, which is not run now")));
        }
        if json["settings"] != *settings {
            return Err(bad(format!("it was made with {}, not {settings}", json["settings"])));
        }
        Ok(Self { file, json })
    }

    pub(super) fn is_of(&self, workload: &str) -> bool {
        self.json["workload"] == workload
    }

    /// What of a result is slower than in this one. An error where they have no times in common.
    pub(super) fn slower(&self, now: &Value) -> Result<Vec<Slower>, BenchError> {
        let pace = |result: &Value| result["pace_ms"].as_f64().filter(|ms| *ms > 0.0);
        // a machine that is slower now explains longer times; one that is faster accuses nobody
        let pace = pace(now).zip(pace(&self.json)).map_or(1.0, |(now, then)| (now / then).max(1.0));
        let workload = now["workload"].as_str().unwrap_or_default().to_string();
        let (then, now) = (figures(&self.json), figures(now));
        let mut slower = Vec::new();
        let mut is_compared = false;
        for (column, rows) in &now {
            let Some(before) = then.get(column) else { continue };
            let both: Vec<(&String, Figure, Figure)> =
                rows.iter().filter_map(|(row, now)| Some((row, *now, *before.get(row)?))).collect();
            is_compared |= !both.is_empty();
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
        if is_compared {
            Ok(slower)
        } else {
            Err(BenchError::Baseline(self.file.clone(), "it has no times to compare".to_string()))
        }
    }
}

/// What was measured of this program in milliseconds, several times, by table and column, then by row.
fn figures(result: &Value) -> BTreeMap<String, BTreeMap<String, Figure>> {
    let mut figures: BTreeMap<String, BTreeMap<String, Figure>> = BTreeMap::new();
    for table in result["tables"].as_array().into_iter().flatten() {
        let name = table["name"].as_str().unwrap_or_default();
        let columns: Vec<&str> =
            table["columns"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
        for row in table["rows"].as_array().into_iter().flatten() {
            let cells = row[1].as_array().into_iter().flatten();
            let is_compared = |column: &str| {
                column.trim_end().ends_with("ms") && !PEERS.iter().any(|peer| column.starts_with(peer))
            };
            for (column, cell) in columns.iter().zip(cells).filter(|(column, _)| is_compared(column)) {
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

    fn told_of(then: Value, now: &Value) -> Vec<String> {
        let then = Baseline { file: "then.json".to_string(), json: then };
        then.slower(now).unwrap().iter().map(ToString::to_string).collect()
    }

    #[test]
    fn what_is_slower_is_named_and_noise_is_not() {
        let then = || result(10.0, [10.0, 100.0]);
        assert!(told_of(then(), &then()).is_empty());
        assert!(told_of(then(), &result(10.0, [11.0, 115.0])).is_empty(), "noise");
        assert!(told_of(then(), &result(10.0, [5.0, 50.0])).is_empty(), "faster");
        assert_eq!(
            told_of(then(), &result(10.0, [15.0, 150.0])),
            ["w: t: a, ms is slower: 1.50 times as long"]
        );
        // a machine that is half as fast explains twice the time
        assert!(told_of(then(), &result(20.0, [20.0, 200.0])).is_empty());
        assert_eq!(told_of(then(), &result(20.0, [40.0, 400.0])).len(), 1);
        assert!(told_of(then(), &result(5.0, [11.0, 110.0])).is_empty(), "a faster machine accuses nobody");
        // one row alone, by more: among so many others it does not move the column
        let one = |now: f64| {
            let many = |y: f64| {
                let mut result = result(10.0, [10.0, y]);
                let rows = result["tables"][0]["rows"].as_array_mut().unwrap();
                (0..8).for_each(|i| rows.push(serde_json::json!([format!("z{i}"), rows[0][1]])));
                result
            };
            told_of(many(100.0), &many(now))
        };
        assert_eq!(one(170.0), ["w: t: a, ms, y is slower: 1.70 times as long"]);
        assert!(one(130.0).is_empty());
    }

    #[test]
    fn what_cannot_be_compared_is_refused() {
        let t = tempfile::tempdir().unwrap();
        let path = t.path().join("then.json");
        let settings = |quick: bool| serde_json::json!({"quick": quick, "threads": 2, "device": null});
        let read = |workload: &str, quick: bool| {
            let json = serde_json::json!({"workload": workload, "settings": settings(quick), "tables": []});
            std::fs::write(&path, json.to_string()).unwrap();
            Baseline::read(&path, &settings(false), &super::super::WORKLOADS[..1])
        };
        let told = |read: Result<Baseline, BenchError>| read.err().map(|e| e.to_string()).unwrap_or_default();
        let of_another = told(read("schedule", false));
        assert!(of_another.contains("then.json: it is of schedule, which is not run now"), "{of_another}");
        let quick = told(read("warm-cold", true));
        assert!(quick.contains(r#""quick":true"#) && quick.contains("--baseline"), "{quick}");
        let empty = read("warm-cold", false).unwrap();
        let nothing = empty.slower(&result(10.0, [10.0, 100.0])).unwrap_err().to_string();
        assert!(nothing.contains("it has no times to compare"), "{nothing}");
        // another program's times are not ours
        let with_peer = |ms: f64| {
            let mut result = result(10.0, [10.0, 100.0]);
            result["tables"][0]["columns"] = serde_json::json!(["tobj, ms", "b, ms"]);
            for row in result["tables"][0]["rows"].as_array_mut().unwrap() {
                row[1][1] = serde_json::json!({"median": 1.0, "least": 1.0, "greatest": 1.0});
                row[1][0]["median"] = serde_json::json!(ms);
            }
            result
        };
        assert!(told_of(with_peer(1.0), &with_peer(9.0)).is_empty());
    }
}
