//! `acm trace view`: the viewer, served on this machine alone.

use super::page::Page;
use crate::cli::{Exit, trace::TraceViewArgs};
use anyhow::anyhow;
use std::{
    io::Write,
    net::{Ipv4Addr, SocketAddr},
};
use tiny_http::{Header, Method, Request, Response, Server};

/// What the page may do: nothing from outside.
const POLICY: &str = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'";

/// Serves the page until Ctrl-C or a request to terminate.
pub fn run(args: &TraceViewArgs) -> anyhow::Result<Exit> {
    let page = Page::read(&args.file)?.html()?;
    let wanted = SocketAddr::from((Ipv4Addr::LOCALHOST, args.port));
    let server = Server::http(wanted)
        .map_err(|e| anyhow!("{wanted} cannot be served: {e}; choose another --port, or none for a free one"))?;
    let address = server.server_addr().to_ip().unwrap_or(wanted);
    let mut out = std::io::stdout().lock();
    writeln!(out, "http://{address}/   {}   Ctrl-C ends it", args.file.display())?;
    out.flush()?;
    let signals = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    std::thread::scope(|threads| {
        threads.spawn(|| {
            for request in server.incoming_requests() {
                answer(request, &page, address);
            }
        });
        let ended = signals.block_on(async {
            let mut terminate = tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate())?;
            tokio::select! {
                ended = tokio::signal::ctrl_c() => ended,
                _ = terminate.recv() => Ok(()),
            }
        });
        server.unblock();
        ended
    })?;
    Ok(Exit::Success)
}

/// Gives the page to whoever asks for it under the address that was printed. Another name in the request means that a
/// page of somebody else's tries to read the trace through the browser.
fn answer(request: Request, page: &str, address: SocketAddr) {
    let header = |name: &str| {
        let mut headers = request.headers().iter();
        headers.find(|header| header.field.as_str().as_str().eq_ignore_ascii_case(name)).map(|h| h.value.as_str())
    };
    let ours = [address.to_string(), format!("localhost:{}", address.port())];
    let path = request.url().split(['?', '#']).next().unwrap_or_default();
    let told = if !header("host").is_some_and(|host| ours.iter().any(|name| name == host)) {
        refused(403, "this trace is served under its own address alone")
    } else if !matches!(request.method(), Method::Get | Method::Head) {
        refused(405, "only GET")
    } else if path == "/" {
        let mut response = Response::from_string(page);
        for (name, value) in [
            ("Content-Type", "text/html; charset=utf-8"),
            ("Content-Security-Policy", POLICY),
            ("Cache-Control", "no-store"),
            ("X-Content-Type-Options", "nosniff"),
        ] {
            response = with(response, name, value);
        }
        response
    } else {
        refused(404, "there is the page / and nothing else")
    };
    if let Err(_gone) = request.respond(told) {
        // The browser has left: nobody is there to be told.
    }
}

type Told = Response<std::io::Cursor<Vec<u8>>>;

fn refused(status: u16, words: &str) -> Told {
    Response::from_string(format!("{words}\n")).with_status_code(status)
}

fn with(response: Told, name: &str, value: &str) -> Told {
    match Header::from_bytes(name, value) {
        Ok(header) => response.with_header(header),
        Err(()) => response,
    }
}
