//! Tells about jobs that finished or failed: a command, a webhook, mail. One thread, one after the other; what cannot be
//! told is said and stops nothing. Each is tried at least once, a webhook three times: what a daemon was killed over, the next one
//! tells again; what was tried in vain is not.

use super::state::Status;
use super::{Message, WatchError};
use lettre::message::Mailbox;
use lettre::{SmtpTransport, Transport};
use std::fmt::Write as _;
use std::io::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::mpsc::{Sender, channel};
use std::time::Duration;

/// Who is told.
#[derive(Clone, Debug, Default)]
pub struct Notices {
    /// A command for the shell; it finds `RENTIX_JOB`, `RENTIX_STATE`, `RENTIX_FOLDER`, `RENTIX_FRAMES`, `RENTIX_FAILED`,
    /// `RENTIX_ERROR` in its environment and the status as JSON on its standard input.
    pub on_done: Option<String>,
    /// How long it may take; then it is killed, and all that it started.
    pub on_done_within: Duration,
    /// A URL to which the status is posted as JSON.
    pub webhook: Option<String>,
    /// An address to which mail goes.
    pub mail: Option<String>,
    /// The server that sends it: `smtp://HOST[:PORT]`, `smtps://USER:PASSWORD@HOST`.
    pub smtp: Option<String>,
}

/// A webhook has so long for each attempt.
const WEBHOOK_WITHIN: Duration = Duration::from_secs(20);
/// What a command finds in its environment of an error is not longer: systems bound it. The whole is on its standard input.
const ERROR_CHARS_MAX: usize = 4096;
/// Pauses before each attempt.
const PAUSES_S: [u64; 3] = [0, 2, 10];
/// A mail server has so long.
const MAIL_WITHIN: Duration = Duration::from_mins(1);

/// The thread that tells.
pub(super) struct Notifier {
    /// One for each end that is due, as the journal keeps them: one that were refused would wait for the next start.
    waiting: Sender<(Status, PathBuf)>,
}

struct Mail {
    to: Mailbox,
    from: Mailbox,
    server: SmtpTransport,
}

impl Notifier {
    /// Checks addresses and begins; None where nobody is to be told.
    pub(super) fn start(notices: &Notices, messages: Sender<Message>) -> Result<Option<Self>, WatchError> {
        if notices.on_done.is_none() && notices.webhook.is_none() && notices.mail.is_none() {
            return Ok(None);
        }
        let mail = notices.mail.as_deref().map(|to| mail(to, notices.smtp.as_deref())).transpose()?;
        if let Some(url) = &notices.webhook
            && !(url.starts_with("http://") || url.starts_with("https://"))
        {
            return Err(WatchError::Notice(format!(
                "--webhook {url}: is no URL that begins with http:// or https://"
            )));
        }
        let (waiting, incoming) = channel::<(Status, PathBuf)>();
        let notices = notices.clone();
        // nobody waits for it: what it is about when the daemon ends is due still
        std::thread::spawn(move || {
            for (status, folder) in incoming {
                let tell = AssertUnwindSafe(|| tell_all(&notices, mail.as_ref(), &status, &folder));
                let failed = catch_unwind(tell).unwrap_or_else(|_| {
                    vec!["internal error while it was told of; please report this".to_owned()]
                });
                // nobody listens any more once the daemon ends
                for why in failed {
                    let _ = messages.send(Message::Note(format!("{}: {why}", status.job)));
                }
                let _ = messages.send(Message::WasTold(Box::new(status)));
            }
        });
        Ok(Some(Self { waiting }))
    }

    /// Tells of a job that ended; what is said where that cannot be. A message comes when it was told.
    pub(super) fn tell(&self, status: &Status, folder: &Path) -> Result<(), String> {
        let sent = self.waiting.send((status.clone(), folder.to_path_buf()));
        sent.map_err(|_| format!("{}: nobody tells any more; the next start does", status.job))
    }
}

/// Tells of an end in every way; what failed.
fn tell_all(notices: &Notices, mail: Option<&Mail>, status: &Status, folder: &Path) -> Vec<String> {
    let mut failed = Vec::new();
    let mut note = |what: &str, told: Result<(), String>| {
        failed.extend(told.err().map(|why| format!("{what}: {why}")));
    };
    if let Some(command) = &notices.on_done {
        note("--on-done", run(command, status, folder, notices.on_done_within));
    }
    if let Some(url) = &notices.webhook {
        note("--webhook", post(url, status));
    }
    if let Some(mail) = mail {
        note("--mail", mail.send(status, folder));
    }
    failed
}

#[cfg(unix)]
const SHELL: [&str; 2] = ["sh", "-c"];
#[cfg(not(unix))]
const SHELL: [&str; 2] = ["cmd", "/C"];

fn run(command: &str, status: &Status, folder: &Path, within: Duration) -> Result<(), String> {
    let mut shell = Command::new(SHELL[0]);
    // a group of its own, so that what it starts can be ended with it
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut shell, 0);
    let error: String = status.error.iter().flat_map(|e| e.chars()).take(ERROR_CHARS_MAX).collect();
    let mut child = shell
        .args([SHELL[1], command])
        .env("RENTIX_JOB", &status.job)
        .env("RENTIX_STATE", status.state.word())
        .env("RENTIX_FOLDER", folder)
        .env("RENTIX_FRAMES", status.frames.all.to_string())
        .env("RENTIX_FAILED", status.frames.failed.to_string())
        .env("RENTIX_ERROR", error)
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .map_err(|e| e.to_string())?;
    let group = child.id();
    let (ends, end) = channel();
    let text = serde_json::to_vec(status).unwrap_or_default();
    std::thread::spawn(move || {
        if let Some(mut input) = child.stdin.take() {
            // a command that does not read it is no worse
            let _ = input.write_all(&text);
        }
        let _ = ends.send(child.wait());
    });
    match end.recv_timeout(within) {
        Ok(Ok(ended)) if ended.success() => Ok(()),
        Ok(Ok(ended)) => Err(format!("`{command}` ended with {ended}")),
        Ok(Err(error)) => Err(error.to_string()),
        Err(_) => {
            kill(group);
            let s = within.as_secs_f64();
            Err(format!("`{command}` took more than {s} s and was killed (--on-done-within gives it longer)"))
        }
    }
}

/// Ends a process group, as the shell does it.
#[cfg(unix)]
fn kill(group: u32) {
    // one that has just ended cannot be killed
    let _ = Command::new("sh").args(["-c", &format!("kill -KILL -{group}")]).stderr(Stdio::null()).status();
}

/// Ends a process and those that it started.
#[cfg(not(unix))]
fn kill(process: u32) {
    let _ = Command::new("taskkill").args(["/T", "/F", "/PID", &process.to_string()]).status();
}

fn post(url: &str, status: &Status) -> Result<(), String> {
    let agent: ureq::Agent =
        ureq::Agent::config_builder().timeout_global(Some(WEBHOOK_WITHIN)).build().into();
    let body = serde_json::to_vec(status).unwrap_or_default();
    let mut why = String::new();
    for pause in PAUSES_S {
        std::thread::sleep(Duration::from_secs(pause));
        match agent.post(url).header("content-type", "application/json").send(&body[..]) {
            Ok(_) => return Ok(()),
            Err(error) => why = error.to_string(),
        }
    }
    Err(format!("{url}: {why}, {} times", PAUSES_S.len()))
}

fn mail(to: &str, smtp: Option<&str>) -> Result<Mail, WatchError> {
    let wrong = |text: String| WatchError::Notice(text);
    let to: Mailbox = to.parse().map_err(|e| wrong(format!("--mail {to}: is no address: {e}")))?;
    let smtp = smtp.unwrap_or("smtp://localhost");
    // the URL may hold a password, which is not told
    let server = SmtpTransport::from_url(smtp)
        .map_err(|e| wrong(format!("--smtp: is no smtp:// or smtps:// URL: {e}")))?
        .timeout(Some(MAIL_WITHIN))
        .build();
    let from = Mailbox::new(Some("rentix".to_owned()), to.email.clone());
    Ok(Mail { to, from, server })
}

impl Mail {
    fn send(&self, status: &Status, folder: &Path) -> Result<(), String> {
        let frames = &status.frames;
        let mut text = format!(
            "{} {}: {} of {} frames are in {}\n",
            status.job,
            status.state.word(),
            frames.done,
            frames.all,
            folder.display()
        );
        if let Some(error) = &status.error {
            let _ = write!(text, "\n{error}\n");
        }
        let message = lettre::Message::builder()
            .from(self.from.clone())
            .to(self.to.clone())
            .subject(format!("{} {}", status.job, status.state.word()))
            .body(text)
            .map_err(|e| e.to_string())?;
        self.server.send(&message).map(drop).map_err(|e| e.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::super::state::State;
    use super::*;
    use crate::clock::Stopwatch;
    use std::io::{BufRead, BufReader, Read};
    use std::net::TcpListener;

    fn status() -> Status {
        Status {
            job: "walk".into(),
            state: State::Failed,
            error: Some("a reason".into()),
            ..Status::default()
        }
    }

    #[test]
    #[cfg(unix)]
    fn a_command_is_told() {
        let t = tempfile::tempdir().unwrap();
        let out = t.path().join("told");
        let command = format!("(echo $RENTIX_JOB $RENTIX_STATE $RENTIX_ERROR; cat) > {}", out.display());
        let run = |command: &str| run(command, &status(), t.path(), Duration::from_mins(1));
        run(&command).unwrap();
        let told = std::fs::read_to_string(out).unwrap();
        assert!(told.starts_with("walk failed a reason\n{\"job\":\"walk\""), "{told}");
        assert!(run("exit 3").unwrap_err().contains('3'));
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_command_that_does_not_end_is_killed_with_all_that_it_started() {
        let t = tempfile::tempdir().unwrap();
        let started = t.path().join("started");
        // neither it nor what it starts reads what is written to it, which is more than a pipe holds
        let command = format!("sleep 1000 & echo $! > {}; sleep 1000", started.display());
        let long = Status { error: Some("x".repeat(1 << 20)), ..status() };
        let said = run(&command, &long, t.path(), Duration::from_secs(1)).unwrap_err();
        assert!(said.contains("killed") && said.contains("--on-done-within"), "{said}");
        let other = std::fs::read_to_string(started).unwrap();
        let is_running = || {
            let stat = std::fs::read_to_string(format!("/proc/{}/stat", other.trim())).unwrap_or_default();
            !stat.is_empty() && !stat.contains(") Z ")
        };
        let watch = Stopwatch::start();
        while is_running() {
            assert!(watch.s() < 120.0, "what it started runs still");
            std::thread::yield_now();
        }
    }

    #[test]
    fn a_webhook_is_posted_to() {
        let server = TcpListener::bind("127.0.0.1:0").unwrap();
        let url = format!("http://{}/hook", server.local_addr().unwrap());
        let heard = std::thread::spawn(move || {
            let (stream, _) = server.accept().unwrap();
            let mut reader = BufReader::new(stream.try_clone().unwrap());
            let (mut line, mut length) = (String::new(), 0);
            while reader.read_line(&mut line).unwrap() > 2 {
                if let Some(n) = line.to_lowercase().strip_prefix("content-length:") {
                    length = n.trim().parse().unwrap();
                }
                line.clear();
            }
            let mut body = vec![0; length];
            reader.read_exact(&mut body).unwrap();
            (&stream)
                .write_all(b"HTTP/1.1 200 OK\r\nContent-Length: 0\r\nConnection: close\r\n\r\n")
                .unwrap();
            serde_json::from_slice::<Status>(&body).unwrap()
        });
        post(&url, &status()).unwrap();
        assert_eq!(heard.join().unwrap(), status());
    }

    #[test]
    fn mail_goes_to_the_server() {
        let server = TcpListener::bind("127.0.0.1:0").unwrap();
        let smtp = format!("smtp://{}", server.local_addr().unwrap());
        let heard = std::thread::spawn(move || {
            let (stream, _) = server.accept().unwrap();
            let mut out = &stream;
            let mut text = String::new();
            out.write_all(b"220 here\r\n").unwrap();
            for line in BufReader::new(stream.try_clone().unwrap()).lines() {
                let line = line.unwrap();
                let answer: &[u8] = match line.as_str() {
                    "DATA" => b"354 go on\r\n",
                    "QUIT" => b"221 bye\r\n",
                    _ if line.starts_with("EHLO") || line.starts_with("MAIL") || line.starts_with("RCPT") => {
                        b"250 fine\r\n"
                    }
                    "." => b"250 taken\r\n",
                    _ => b"",
                };
                out.write_all(answer).unwrap();
                text += &(line.clone() + "\n");
                if line == "." {
                    return text;
                }
            }
            text
        });
        mail("someone@example.org", Some(&smtp)).unwrap().send(&status(), Path::new("/out/walk")).unwrap();
        let text = heard.join().unwrap();
        for part in ["RCPT TO:<someone@example.org>", "Subject: walk failed", "a reason", "/out/walk"] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }

    #[test]
    fn wrong_addresses_are_named() {
        let (messages, _keep) = channel();
        let start = |notices| Notifier::start(&notices, messages.clone()).map(drop).unwrap_err().to_string();
        assert!(start(Notices { webhook: Some("ftp://x".into()), ..Notices::default() }).contains("ftp://x"));
        assert!(start(Notices { mail: Some("nobody".into()), ..Notices::default() }).contains("nobody"));
        let smtp = Notices {
            mail: Some("a@b.c".into()),
            smtp: Some("http://u:secret@x".into()),
            ..Notices::default()
        };
        let said = start(smtp);
        assert!(said.contains("--smtp") && !said.contains("secret"), "{said}");
    }
}
