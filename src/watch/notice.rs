//! Tells about jobs that finished or failed: a command, a webhook, mail. One thread, one after the other; what cannot be
//! told is said and stops nothing.

use super::state::Status;
use super::{Message, WatchError};
use lettre::message::Mailbox;
use lettre::{SmtpTransport, Transport};
use std::fmt::Write as _;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::mpsc::{Sender, SyncSender, TrySendError, sync_channel};
use std::time::Duration;

/// Who is told.
#[derive(Clone, Debug, Default)]
pub struct Notices {
    /// A command for the shell; it finds `RENTIX_JOB`, `RENTIX_STATE`, `RENTIX_FOLDER`, `RENTIX_FRAMES`, `RENTIX_FAILED`,
    /// `RENTIX_ERROR` in its environment and the status as JSON on its standard input.
    pub on_done: Option<String>,
    /// A URL to which the status is posted as JSON.
    pub webhook: Option<String>,
    /// An address to which mail goes.
    pub mail: Option<String>,
    /// The server that sends it: `smtp://HOST[:PORT]`, `smtps://USER:PASSWORD@HOST`.
    pub smtp: Option<String>,
}

/// So many notices wait; more are dropped, and that is said.
const WAITING_MAX: usize = 1_000;
/// A webhook has so long for each attempt.
const WEBHOOK_WITHIN: Duration = Duration::from_secs(20);
/// Pauses before each attempt.
const PAUSES_S: [u64; 3] = [0, 2, 10];
/// A mail server has so long.
const MAIL_WITHIN: Duration = Duration::from_mins(1);

/// The thread that tells.
pub(super) struct Notifier {
    waiting: Option<SyncSender<(Status, PathBuf)>>,
    thread: Option<std::thread::JoinHandle<()>>,
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
        let (waiting, incoming) = sync_channel::<(Status, PathBuf)>(WAITING_MAX);
        let notices = notices.clone();
        let thread = std::thread::spawn(move || {
            for (status, folder) in incoming {
                let note = |what: &str, why: String| {
                    // nobody listens any more once the daemon ends
                    let _ = messages.send(Message::Note(format!("{}: {what}: {why}", status.job)));
                };
                if let Some(command) = &notices.on_done
                    && let Err(why) = run(command, &status, &folder)
                {
                    note("--on-done", why);
                }
                if let Some(url) = &notices.webhook
                    && let Err(why) = post(url, &status)
                {
                    note("--webhook", why);
                }
                if let Some(mail) = &mail
                    && let Err(why) = mail.send(&status, &folder)
                {
                    note("--mail", why);
                }
            }
        });
        Ok(Some(Self { waiting: Some(waiting), thread: Some(thread) }))
    }

    /// What still waits is not told: the daemon ends at once.
    pub(super) fn leave(&mut self) {
        self.waiting = None;
        self.thread = None;
    }

    /// Tells of a job that ended; what is said where that cannot be.
    pub(super) fn tell(&self, status: &Status, folder: &Path) -> Result<(), String> {
        let waiting = self.waiting.as_ref().ok_or("nobody tells any more")?;
        waiting.try_send((status.clone(), folder.to_path_buf())).map_err(|error| match error {
            TrySendError::Full(_) => {
                format!("{}: {WAITING_MAX} notices wait already; nobody is told of it", status.job)
            }
            TrySendError::Disconnected(_) => format!("{}: nobody tells any more", status.job),
        })
    }
}

impl Drop for Notifier {
    fn drop(&mut self) {
        self.waiting = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

#[cfg(unix)]
const SHELL: [&str; 2] = ["sh", "-c"];
#[cfg(not(unix))]
const SHELL: [&str; 2] = ["cmd", "/C"];

fn run(command: &str, status: &Status, folder: &Path) -> Result<(), String> {
    let mut child = Command::new(SHELL[0])
        .args([SHELL[1], command])
        .env("RENTIX_JOB", &status.job)
        .env("RENTIX_STATE", status.state.word())
        .env("RENTIX_FOLDER", folder)
        .env("RENTIX_FRAMES", status.frames.all.to_string())
        .env("RENTIX_FAILED", status.frames.failed.to_string())
        .env("RENTIX_ERROR", status.error.as_deref().unwrap_or_default())
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .map_err(|e| e.to_string())?;
    if let Some(mut input) = child.stdin.take() {
        // a command that does not read it is no worse
        let _ = input.write_all(&serde_json::to_vec(status).unwrap_or_default());
    }
    let ended = child.wait().map_err(|e| e.to_string())?;
    if ended.success() { Ok(()) } else { Err(format!("`{command}` ended with {ended}")) }
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
    use std::io::{BufRead, BufReader, Read};
    use std::net::TcpListener;
    use std::sync::mpsc::channel;

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
        run(&command, &status(), t.path()).unwrap();
        let told = std::fs::read_to_string(out).unwrap();
        assert!(told.starts_with("walk failed a reason\n{\"job\":\"walk\""), "{told}");
        assert!(run("exit 3", &status(), t.path()).unwrap_err().contains('3'));
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
