//! Writes the manual pages, one for each command, and the shells' completions into a folder.
//!
//! `cargo man [FOLDER]` (target/man).

use clap::{CommandFactory, ValueEnum};
use rentix::cli::Cli;
use std::path::PathBuf;

fn main() -> std::io::Result<()> {
    let folder = PathBuf::from(std::env::args_os().nth(1).unwrap_or_else(|| "target/man".into()));
    std::fs::create_dir_all(&folder)?;
    clap_mangen::generate_to(Cli::command(), &folder)?;
    for &shell in clap_complete::Shell::value_variants() {
        clap_complete::generate_to(shell, &mut Cli::command(), "rentix", &folder)?;
    }
    println!("{}", folder.display());
    Ok(())
}
