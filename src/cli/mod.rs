//! What was typed, what it means, a call below; the only room that prints.

#[macro_use]
mod say;

mod bench;
mod cache;
mod compare;
mod completions;
mod costs;
mod devices;
mod driver;
mod inspect;
mod progress;
mod render;
mod render_args;
mod request;
mod size;
mod stop;
mod store;
mod verify;
mod watch;

use clap::{Args, CommandFactory as _, FromArgMatches as _, Parser, Subcommand, ValueEnum};
use std::process::ExitCode;

/// Something was asked for that is not there now (also: pictures differ).
const EXIT_FAILED: u8 = 1;
/// Nothing was tried: wrong use, unreadable input, unwritable output, no such device.
const EXIT_USE: u8 = 2;
/// No device could do it; another machine may.
const EXIT_NO_DEVICE: u8 = 3;

/// Renders animation sequences (folders of OBJ frames) to pictures by ray tracing, headless.
#[derive(Parser, Debug)]
#[command(
    name = "rentix",
    version,
    propagate_version = true,
    args_override_self = true,
    max_term_width = 100
)]
#[command(
    after_help = "Example: rentix render walk/ -o out/walk --size fullhd\n\nExit status: 0 all is there, 1 some frames failed, 2 nothing was tried, 3 no device could do it, 130/143 stopped."
)]
pub struct Cli {
    #[command(flatten)]
    global: Global,
    #[command(subcommand)]
    command: Command,
}

/// Options that every command takes.
#[derive(Args, Debug, Clone)]
pub struct Global {
    /// Say less: errors only
    #[arg(short, long, global = true)]
    quiet: bool,
    /// Say more
    #[arg(short, long, global = true)]
    verbose: bool,
    /// One JSON object a line on stdout
    #[arg(long, global = true)]
    json: bool,
    /// Colours on a terminal
    #[arg(long, global = true, value_name = "WHEN", default_value = "auto")]
    color: Color, // [`say::color`] reads it before all else: wrong use is told in colours, too
}

/// When to use colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Color {
    Auto,
    Always,
    Never,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Renders sequences to pictures
    #[command(
        after_help = "Examples:\n  rentix render walk/\n  rentix render 'walk/walk_####.obj' --frames 1-100x2 --size 1920x1080 --samples 16 -o out\n  rentix render job.yaml"
    )]
    Render(Box<render_args::RenderArgs>),
    /// Renders what is put into a folder, until it is stopped
    #[command(
        override_usage = "rentix watch [OPTIONS] <INBOX>",
        mut_arg("inputs", |a| a.value_name("INBOX").num_args(1).required(true).help("The folder: a folder or a .zip, .tar, .tar.gz or .tar.zst in it is a job")),
        mut_arg("output", |a| a.help("Where pictures go, each job's to DIR/NAME [default: out]")),
        mut_args(|a| if watch::NOT_TAKEN.contains(&a.get_id().as_str()) { a.hide(true) } else { a }),
        after_help = "Examples:\n  rentix watch inbox/ -o done/ --size fullhd\n  rentix watch inbox/ -o done/ --follow --listen 127.0.0.1:8080 --on-done 'echo $RENTIX_JOB $RENTIX_STATE'\n\nA job.yaml inside a job says how it is rendered and wins over the options. `.done` inside a job, or NAME.done beside it, starts it at once; `.cancel` cancels it. One DIR belongs to one INBOX."
    )]
    Watch(Box<watch::WatchArgs>),
    /// Renders warm and cold and in several orders, and compares byte for byte
    #[command(
        mut_args(|a| if verify::NOT_TAKEN.contains(&a.get_id().as_str()) { a.hide(true) } else { a }),
        after_help = "Example: rentix verify walk/ --size 160x90 --update refit\n\nExit status: 0 equal, 1 they differ, the first frame and pixel that do are named; 2 nothing could be compared."
    )]
    Verify(Box<render_args::RenderArgs>),
    /// Tells what is in a sequence, what changes from frame to frame and what it will cost; renders nothing
    #[command(after_help = "Example: rentix inspect walk/")]
    Inspect(Box<render_args::RenderArgs>),
    /// Compares two pictures or two folders of pictures
    #[command(
        after_help = "Example: rentix compare out/a out/b --flip 0.005\n\nExit status: 0 equal (or within --flip), 1 they differ, 2 unreadable."
    )]
    Compare(compare::CompareArgs),
    /// Measures how fast things are, beside other programs where they are installed
    #[command(
        after_help = "Example: rentix bench updates --scenes scenes/ -o bench\n\nTables go to stdout; tables as JSON and charts to the folder."
    )]
    Bench(bench::BenchArgs),
    /// Tells what is in the store on disk, or removes of it
    #[command(after_help = "Example: rentix cache stat")]
    Cache(cache::CacheArgs),
    /// Lists what can render
    #[command(after_help = "Example: rentix devices --json")]
    Devices,
    /// Prints a completion script for a shell
    #[command(
        after_help = "Example: rentix completions bash > ~/.local/share/bash-completion/completions/rentix"
    )]
    Completions {
        /// Which shell
        shell: clap_complete::Shell,
    },
}

/// Runs the program; the exit status is CONTRACT 1's.
pub fn main() -> ExitCode {
    driver::needs_no_display();
    stop::early();
    let color = say::color(std::env::args_os());
    color.write_global();
    let color = match color {
        anstream::ColorChoice::Always => clap::ColorChoice::Always,
        anstream::ColorChoice::Never => clap::ColorChoice::Never,
        _ => clap::ColorChoice::Auto,
    };
    let matches = Cli::command().color(color).try_get_matches();
    let cli = match matches.and_then(|matches| Cli::from_arg_matches(&matches)) {
        Ok(cli) => cli,
        Err(error) => {
            // a closed pipe is no reason to fail
            let _ = error.print();
            return if error.use_stderr() { ExitCode::from(EXIT_USE) } else { ExitCode::SUCCESS };
        }
    };
    let ended = match &cli.command {
        Command::Render(args) => render::render(args, &cli.global),
        Command::Watch(args) => watch::watch(args, &cli.global),
        Command::Verify(args) => verify::verify(args, &cli.global),
        Command::Inspect(args) => inspect::inspect(args, &cli.global),
        Command::Compare(args) => compare::compare(args, &cli.global),
        Command::Bench(args) => bench::bench(args, &cli.global),
        Command::Cache(args) => cache::cache(args, &cli.global),
        Command::Devices => devices::devices(&cli.global),
        Command::Completions { shell } => Ok(completions::completions(*shell)),
    };
    ended.unwrap_or_else(|error| {
        let text = said_once(&error);
        if cli.global.json {
            out!("{}", serde_json::json!({"event": "error", "text": text}));
        }
        err!("error: {text}");
        ExitCode::from(EXIT_USE)
    })
}

/// An error and its causes, without those that it names itself.
fn said_once(error: &anyhow::Error) -> String {
    let mut text = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !text.contains(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    text
}
