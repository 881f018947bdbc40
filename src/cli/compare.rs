//! `rentix compare A B`.

use super::{EXIT_FAILED, Global};
use crate::film::compare::Comparison;
use crate::output::{PictureOutcome, compare_paths};
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;
use std::process::ExitCode;

/// What `compare` takes.
#[derive(Args, Debug)]
pub(super) struct CompareArgs {
    /// A picture or a folder of pictures
    a: PathBuf,
    /// What to compare it with
    b: PathBuf,
    /// Allow a mean FLIP up to this
    #[arg(long, value_name = "X")]
    flip: Option<f64>,
}

/// Compares and tells of each picture.
pub(super) fn compare(args: &CompareArgs, global: &Global) -> Result<ExitCode> {
    let mut differ = 0;
    let pictures = compare_paths(&args.a, &args.b)?;
    for p in &pictures {
        let name = p.picture.display().to_string();
        match &p.outcome {
            PictureOutcome::Compared(c) => {
                let allowed = c.psnr.is_none() || args.flip.is_some_and(|flip| c.flip <= flip);
                differ += usize::from(!allowed);
                tell(&name, c, allowed, global);
            }
            PictureOutcome::Incomparable(why) => {
                differ += 1;
                if global.json {
                    out!("{}", serde_json::json!({"event": "incomparable", "name": name, "error": why}));
                } else {
                    out!("{name}: {why}");
                }
            }
        }
    }
    if !global.json && !global.quiet {
        err!("{} pictures compared, {differ} differ", pictures.len());
    }
    Ok(if differ == 0 { ExitCode::SUCCESS } else { ExitCode::from(EXIT_FAILED) })
}

fn tell(name: &str, c: &Comparison, allowed: bool, global: &Global) {
    if global.json {
        let line = serde_json::json!({"picture": name, "max": c.max, "rmse": c.rmse, "psnr": c.psnr, "flip": c.flip});
        out!("{line}");
    } else if c.psnr.is_none() {
        if global.verbose {
            out!("{name}: equal");
        }
    } else {
        let psnr = c.psnr.map_or_else(|| "infinite".to_string(), |p| format!("{p:.1} dB"));
        let verdict = if allowed { ", within --flip" } else { "" };
        out!("{name}: max {:.4}, RMSE {:.6}, PSNR {psnr}, FLIP {:.5}{verdict}", c.max, c.rmse, c.flip);
    }
}
