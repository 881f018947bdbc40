//! `rentix compare A B`.

use super::{EXIT_FAILED, EXIT_USE, Global};
use crate::film::compare::Comparison;
use crate::output::{PictureOutcome, compare_paths};
use anyhow::Result;
use clap::Args;
use std::fmt::Write as _;
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
    #[arg(long, value_name = "X", value_parser = share)]
    flip: Option<f64>,
}

fn share(text: &str) -> Result<f64, String> {
    let share = text.parse().map_err(|_| "no number".to_string())?;
    if (0.0..=1.0).contains(&share) {
        Ok(share)
    } else {
        Err("out of range: allowed from 0 to 1".to_string())
    }
}

/// Compares and tells of each picture.
pub(super) fn compare(args: &CompareArgs, global: &Global) -> Result<ExitCode> {
    let [mut compared, mut differ, mut alone, mut unreadable] = [0; 4];
    for p in &compare_paths(&args.a, &args.b)? {
        let name = p.picture.display().to_string();
        match &p.outcome {
            PictureOutcome::Compared(c) => {
                let allowed = c.psnr.is_none() || args.flip.is_some_and(|flip| c.flip <= flip);
                compared += 1;
                differ += usize::from(!allowed);
                tell(&name, c, allowed, global);
            }
            PictureOutcome::Incomparable(why) => {
                compared += 1;
                differ += 1;
                tell_why(&name, "incomparable", why, global);
            }
            PictureOutcome::Alone(folder) => {
                alone += 1;
                tell_why(&name, "incomparable", &format!("is only in {}", folder.display()), global);
            }
            PictureOutcome::Unreadable(why) => {
                unreadable += 1;
                tell_why(&name, "unreadable", why, global);
            }
        }
    }
    if !global.json && !global.quiet {
        let mut line = format!("{compared} pictures compared, {differ} differ");
        for (count, what) in [(alone, "are in one folder only"), (unreadable, "cannot be read")] {
            if count > 0 {
                let _ = write!(line, ", {count} {what}");
            }
        }
        err!("{line}");
    }
    Ok(match (unreadable, differ + alone) {
        (0, 0) => ExitCode::SUCCESS,
        (0, _) => ExitCode::from(EXIT_FAILED),
        // whether they differ is not known
        _ => ExitCode::from(EXIT_USE),
    })
}

fn tell_why(name: &str, event: &str, why: &str, global: &Global) {
    if global.json {
        out!("{}", serde_json::json!({"event": event, "name": name, "error": why}));
    } else {
        out!("{name}: {why}");
    }
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
