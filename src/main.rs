//! Arguments in, exit status out.

fn main() -> std::process::ExitCode {
    rentix::cli::main()
}
