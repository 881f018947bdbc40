//! The page with all tables and charts, which needs nothing but itself.

use super::peers::Peer;
use super::table::Table;
use super::{Bench, Cell, Drawn, Findings, Slower, Workload};
use crate::run::machine;
use std::fmt::Write as _;

const STYLE: &str = "body{font:16px/1.5 system-ui,sans-serif;margin:0 auto;max-width:62rem;padding:1rem;color:#1a1a1a;background:#fff}\
h1{font-size:1.6rem}h2{font-size:1.25rem;margin-top:2.5rem;border-bottom:1px solid #ccc}p.about{max-width:46rem}\
.wide{overflow-x:auto}table{border-collapse:collapse;font-size:.85rem;font-variant-numeric:tabular-nums;margin:1rem 0}\
th,td{padding:.2rem .6rem;text-align:right;border-bottom:1px solid #e5e5e5;white-space:nowrap}\
th:first-child,td:first-child{text-align:left;position:sticky;left:0;background:#fff}thead th{vertical-align:bottom;white-space:normal}\
td small{color:#595959}svg{min-width:40rem;max-width:100%;height:auto}.slower{color:#a33}";

/// The page while it grows.
pub(super) struct Page {
    head: String,
    body: String,
}

impl Page {
    pub(super) fn new(bench: &Bench, peers: &[Peer]) -> Self {
        let machine = machine::machine();
        let mut head = format!(
            "<h1>rentix {} measured</h1><p>{}, {} threads of {} cores, {:.0} GiB{}. Times are medians; in small print the least and the greatest.</p>",
            env!("CARGO_PKG_VERSION"),
            escaped(&machine.cpu),
            bench.options.threads,
            machine.cores,
            machine.memory_bytes as f64 / f64::from(1 << 30),
            if bench.options.quick { ", fewer runs and smaller scenes (--quick)" } else { "" }
        );
        head += "<div class=wide><table><thead><tr><th>peer</th><th>by what</th><th>version</th></tr></thead><tbody>";
        for peer in peers {
            let version = peer.version.as_deref().map_or("absent".to_string(), escaped);
            let _ = write!(head, "<tr><td>{}</td><td>{}</td><td>{version}</td></tr>", peer.name, peer.role);
        }
        head += "</tbody></table></div>";
        Self { head, body: String::new() }
    }

    pub(super) fn add(&mut self, workload: &Workload, found: &Findings) {
        let _ = write!(self.body, "<h2>{}</h2><p class=about>{}</p>", workload.name, escaped(workload.about));
        for Drawn { svg, .. } in &found.charts {
            let _ = write!(
                self.body,
                "<div class=wide>{}</div>",
                svg.get(svg.find("<svg").unwrap_or(0)..).unwrap_or_default()
            );
        }
        found.tables.iter().for_each(|table| self.table(table));
    }

    fn table(&mut self, table: &Table) {
        let _ = write!(
            self.body,
            "<p class=about>{}</p><div class=wide><table><thead><tr><th></th>",
            escaped(&table.about)
        );
        for column in &table.columns {
            let _ = write!(self.body, "<th>{}</th>", escaped(column));
        }
        self.body += "</tr></thead><tbody>";
        for (name, cells) in &table.rows {
            let _ = write!(self.body, "<tr><td>{}</td>", escaped(name));
            for cell in cells {
                let _ = write!(self.body, "<td>{cell}");
                if let Cell::Measured(spread) = cell {
                    let [least, greatest] = [spread.least, spread.greatest].map(Cell::Number);
                    let _ = write!(self.body, " <small>{least}–{greatest}</small>");
                }
                self.body += "</td>";
            }
            self.body += "</tr>";
        }
        self.body += "</tbody></table></div>";
    }

    /// The whole page.
    pub(super) fn html(&self, slower: &[Slower]) -> String {
        let mut told = String::new();
        for one in slower {
            let _ = write!(told, "<p class=slower>{}</p>", escaped(&one.to_string()));
        }
        format!(
            "<!doctype html><html lang=en><meta charset=utf-8><meta name=viewport content=\"width=device-width\"><title>rentix measured</title><style>{STYLE}</style>{}{told}{}</html>\n",
            self.head, self.body
        )
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
