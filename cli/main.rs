//! The command `thetahat`.

fn main() -> std::process::ExitCode {
    thetahat_cli::run(std::env::args_os()).into()
}
