//! The status page: what there is and how it goes, for people, for Prometheus, for probes. It only tells; nothing can be
//! changed through it.

use super::WatchError;
use super::state::{State, Status};
use super::view::{Shared, View};
use axum::Router;
use axum::http::header::{CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, X_CONTENT_TYPE_OPTIONS};
use axum::http::{HeaderName, StatusCode};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use std::fmt::Write as _;
use std::net::{SocketAddr, TcpListener};

/// A picture that is shown is not larger.
const PICTURE_BYTES_MAX: u64 = 64 << 20;
/// Formats that browsers show.
const SHOWN: [(&str, &str); 6] = [
    ("png", "image/png"),
    ("jpg", "image/jpeg"),
    ("jpeg", "image/jpeg"),
    ("jpe", "image/jpeg"),
    ("webp", "image/webp"),
    ("bmp", "image/bmp"),
];

/// Serves the page from a thread of its own until the process ends; the address it is at.
pub(super) fn serve(address: SocketAddr, view: &Shared) -> Result<SocketAddr, WatchError> {
    let listen = |source| WatchError::Listen { address, source };
    let listener = TcpListener::bind(address).map_err(listen)?;
    listener.set_nonblocking(true).map_err(listen)?;
    let at = listener.local_addr().map_err(listen)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(listen)?;
    let router = router(view);
    std::thread::spawn(move || {
        runtime.block_on(async {
            if let Ok(listener) = tokio::net::TcpListener::from_std(listener) {
                // it ends with the process
                let _ = axum::serve(listener, router).await;
            }
        });
    });
    Ok(at)
}

fn router(view: &Shared) -> Router {
    let of = |answer: fn(&View) -> Response| {
        let view = view.clone();
        get(move || std::future::ready(answer(&view.lock())))
    };
    let last = view.clone();
    Router::new()
        .route("/", of(|view| text("text/html; charset=utf-8", html(view))))
        .route("/metrics", of(|view| text("text/plain; version=0.0.4; charset=utf-8", metrics(view))))
        .route("/healthz", of(health))
        .route("/jobs.json", of(|view| text("application/json", jobs(view))))
        // apart from the lock, which the driving thread must not wait for while a file is read
        .route("/picture", get(move || std::future::ready(picture(&last))))
}

fn headers(kind: &str) -> [(HeaderName, String); 4] {
    let policy = "default-src 'none'; img-src 'self'; style-src 'unsafe-inline'";
    [
        (CONTENT_TYPE, kind.to_owned()),
        (CACHE_CONTROL, "no-store".to_owned()),
        (CONTENT_SECURITY_POLICY, policy.to_owned()),
        (X_CONTENT_TYPE_OPTIONS, "nosniff".to_owned()),
    ]
}

fn text(kind: &str, body: String) -> Response {
    (headers(kind), body).into_response()
}

fn health(view: &View) -> Response {
    match &view.trouble {
        None => text("text/plain", "ok\n".to_owned()),
        Some(trouble) => {
            let body = format!("{trouble}\n");
            (StatusCode::SERVICE_UNAVAILABLE, headers("text/plain; charset=utf-8"), body).into_response()
        }
    }
}

fn jobs(view: &View) -> String {
    let jobs: Vec<&Status> = view.open.iter().chain(&view.ended).collect();
    serde_json::to_string(&jobs).unwrap_or_default()
}

fn picture(view: &Shared) -> Response {
    let path = view.lock().picture.as_ref().map(|(_, path)| path.clone());
    let shown = path.as_deref().and_then(|path| {
        let kind = kind_of(path)?;
        let is_small = path.metadata().is_ok_and(|m| m.is_file() && m.len() <= PICTURE_BYTES_MAX);
        is_small
            .then(|| std::fs::read(path).ok())
            .flatten()
            .map(|bytes| (headers(kind), bytes).into_response())
    });
    shown.unwrap_or_else(|| StatusCode::NOT_FOUND.into_response())
}

fn kind_of(path: &std::path::Path) -> Option<&'static str> {
    let extension = path.extension()?.to_str()?;
    SHOWN.iter().find(|(e, _)| *e == extension).map(|(_, kind)| *kind)
}

fn escaped(text: &str) -> String {
    text.chars().fold(String::with_capacity(text.len()), |mut out, c| {
        match c {
            '&' => out += "&amp;",
            '<' => out += "&lt;",
            '>' => out += "&gt;",
            '"' => out += "&quot;",
            '\'' => out += "&#39;",
            c => out.push(c),
        }
        out
    })
}

const STYLE: &str = "body{font:14px system-ui;margin:2em;max-width:75em}table{border-collapse:collapse;margin:1em 0}\
td,th{padding:.25em .8em;text-align:left;border-bottom:1px solid #ccc}td.n{text-align:right}progress{width:8em}\
.failed{color:#b00}.finished{color:#070}img{max-width:40em}";

fn html(view: &View) -> String {
    let mut page = format!(
        "<!doctype html><html lang=en><meta charset=utf-8><meta http-equiv=refresh content=5><title>rentix watch</title>\
         <style>{STYLE}</style><h1>rentix watch</h1>"
    );
    if let Some(trouble) = &view.trouble {
        let _ = write!(page, "<p class=failed>{}</p>", escaped(trouble));
    }
    let counts = State::ALL.iter().zip(view.counts).filter(|(_, n)| *n > 0);
    let counts: Vec<String> = counts.map(|(state, n)| format!("{n} {}", state.word())).collect();
    let _ = write!(
        page,
        "<p>{}</p><h2>Jobs</h2><table><tr><th>job<th>state<th>frames<th><th>priority<th>error",
        counts.join(", ")
    );
    for s in view.open.iter().chain(&view.ended) {
        let f = &s.frames;
        let _ = write!(
            page,
            "<tr><td>{}<td class={word}>{word}<td class=n>{} of {}<td><progress value={} max={}></progress><td class=n>{}<td>{}",
            escaped(&s.job),
            f.done,
            f.all,
            f.done + f.failed,
            f.all.max(1),
            s.priority,
            escaped(s.error.as_deref().unwrap_or_default()),
            word = s.state.word(),
        );
    }
    page += "</table><h2>Devices</h2><table><tr><th>device<th>frames<th>busy, s<th>resident, MB<th>budget, MB<th>hits<th>misses<th>evictions";
    for d in &view.devices {
        let r = &d.resident;
        let _ = write!(
            page,
            "<tr><td>{}<td class=n>{}<td class=n>{:.1}<td class=n>{:.1}<td class=n>{:.0}<td class=n>{}<td class=n>{}<td class=n>{}",
            escaped(&d.name),
            d.frames,
            d.busy_s,
            r.bytes as f64 / 1e6,
            r.budget as f64 / 1e6,
            r.hits,
            r.misses,
            r.evictions
        );
    }
    page += "</table>";
    if let Some((job, path)) = &view.picture {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let _ = write!(page, "<h2>Last picture</h2><p>{}: {}</p>", escaped(job), escaped(&name));
        if kind_of(path).is_some() {
            page += "<img src=picture alt=''>";
        }
    }
    page + "</html>"
}

/// Prometheus' text format (exposition format 0.0.4).
fn metrics(view: &View) -> String {
    let mut out = String::new();
    let mut family = |name: &str, kind: &str, help: &str, samples: &[(String, f64)]| {
        let _ = writeln!(out, "# HELP rentix_{name} {help}\n# TYPE rentix_{name} {kind}");
        for (labels, value) in samples {
            let _ = writeln!(out, "rentix_{name}{labels} {value}");
        }
    };
    let states = State::ALL.iter().zip(view.counts);
    let states: Vec<_> = states.map(|(s, n)| (format!("{{state=\"{}\"}}", s.word()), n as f64)).collect();
    family("jobs", "gauge", "Jobs in the inbox by their states.", &states);
    let [done, failed] = view.frames.map(|n| n as f64);
    let ends = [("{status=\"done\"}".to_owned(), done), ("{status=\"failed\"}".to_owned(), failed)];
    family("frames_total", "counter", "Frames that ended since the start.", &ends);
    family("up_seconds", "gauge", "Seconds since the start.", &[(String::new(), view.up_s)]);
    let mut devices = |name: &str, kind: &str, help: &str, value: fn(&crate::run::DeviceReport) -> f64| {
        let label = |name: &str| format!("{{device=\"{}\"}}", name.replace(['\\', '"', '\n'], "_"));
        let samples: Vec<_> = view.devices.iter().map(|d| (label(&d.name), value(d))).collect();
        family(name, kind, help, &samples);
    };
    devices("device_frames_total", "counter", "Frames traced.", |d| d.frames as f64);
    devices("device_busy_seconds_total", "counter", "Seconds of work.", |d| d.busy_s);
    devices("device_resident_bytes", "gauge", "Bytes held.", |d| d.resident.bytes as f64);
    devices("device_budget_bytes", "gauge", "Bytes that may be held.", |d| d.resident.budget as f64);
    devices("device_evictions_total", "counter", "Parts given up for want of space.", |d| {
        d.resident.evictions as f64
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Read, Write};
    use std::net::TcpStream;

    fn ask(at: SocketAddr, line: &str) -> String {
        let mut stream = TcpStream::connect(at).unwrap();
        write!(stream, "{line} HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n").unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        String::from_utf8_lossy(&answer).into_owned()
    }

    #[test]
    fn it_tells_and_only_tells() {
        let view = Shared::default();
        let mut status = Status { job: "<walk>".into(), ..Status::default() };
        status.frames.all = 8;
        view.lock().open.push(status);
        view.lock().counts[0] = 1;
        let t = tempfile::tempdir().unwrap();
        let at = serve("127.0.0.1:0".parse().unwrap(), &view).unwrap();
        let page = ask(at, "GET /");
        assert!(
            page.starts_with("HTTP/1.1 200") && page.contains("&lt;walk&gt;") && !page.contains("<walk>"),
            "{page}"
        );
        assert!(ask(at, "GET /metrics").contains("rentix_jobs{state=\"received\"} 1\n"));
        assert!(ask(at, "GET /jobs.json").contains("\"state\":\"received\""));
        assert!(ask(at, "GET /healthz").ends_with("ok\n"));
        assert!(ask(at, "GET /picture").starts_with("HTTP/1.1 404"));
        std::fs::write(t.path().join("a.png"), "pixels").unwrap();
        view.lock().picture = Some(("walk".into(), t.path().join("a.png")));
        assert!(ask(at, "GET /picture").ends_with("pixels"));
        for method in ["POST", "PUT", "DELETE", "PATCH"] {
            assert!(ask(at, &format!("{method} /")).starts_with("HTTP/1.1 405"), "{method}");
        }
        assert!(ask(at, "GET /../etc/passwd").starts_with("HTTP/1.1 404"));
        view.lock().trouble = Some("the disk is full".into());
        assert!(ask(at, "GET /healthz").starts_with("HTTP/1.1 503"));
        let error = serve(at, &view).unwrap_err().to_string();
        assert!(error.contains(&at.to_string()) && error.contains("--listen"), "{error}");
    }
}
