//! A real browser, driven through its debugging pipe: what a person does with mouse and keys.

use serde_json::{Value, json};
use std::{
    io::{BufRead, BufReader, Write},
    path::{Path, PathBuf},
    process::{Child, ChildStdin, ChildStdout, Command, Stdio},
};

/// Names under which the browser is installed.
const NAMES: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "chrome"];

/// The browser on this machine, if there is one.
pub fn program() -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    std::env::split_paths(&path).flat_map(|folder| NAMES.map(|name| folder.join(name))).find(|file| file.is_file())
}

/// One page in a browser without a window.
pub struct Browser {
    child: Child,
    to: ChildStdin,
    from: BufReader<ChildStdout>,
    _profile: tempfile::TempDir,
    session: Value,
    last: u64,
    /// What the page complained about.
    pub complaints: Vec<String>,
}

impl Browser {
    /// Starts the browser with an empty page.
    pub fn start(program: &Path) -> Browser {
        let profile = tempfile::tempdir().unwrap();
        // The pipe's ends are to be file descriptors 3 and 4.
        let mut child = Command::new("sh")
            .args(["-c", r#"exec "$0" "$@" 3<&0 4>&1 </dev/null >/dev/null 2>&1"#])
            .arg(program)
            .args(["--headless=new", "--remote-debugging-pipe", "--no-sandbox", "--disable-gpu", "--no-first-run"])
            .args(["--disable-dev-shm-usage", "--hide-scrollbars"])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let (to, from) = (child.stdin.take().unwrap(), BufReader::new(child.stdout.take().unwrap()));
        let complaints = Vec::new();
        let mut browser = Browser { child, to, from, _profile: profile, session: Value::Null, last: 0, complaints };
        let target = browser.call("Target.createTarget", json!({ "url": "about:blank" }));
        let attached = json!({ "targetId": target["targetId"], "flatten": true });
        browser.session = browser.call("Target.attachToTarget", attached)["sessionId"].clone();
        for domain in ["Page.enable", "Runtime.enable", "Log.enable", "Network.enable"] {
            browser.call(domain, json!({}));
        }
        browser
    }

    /// Opens an address and waits until it is there.
    pub fn open(&mut self, url: &str) {
        self.call("Page.navigate", json!({ "url": url }));
        for _ in 0..1000 {
            if self.ask("document.readyState === 'complete' && location.href !== 'about:blank'") == true {
                self.settle();
                return assert_eq!(self.complaints, Vec::<String>::new(), "{url}");
            }
        }
        panic!("{url} was not loaded; {:?}", self.complaints);
    }

    /// The value of an expression in the page.
    pub fn ask(&mut self, expression: &str) -> Value {
        let asked = json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let answer = self.call("Runtime.evaluate", asked);
        assert!(answer.get("exceptionDetails").is_none(), "{expression}: {}", answer["exceptionDetails"]);
        answer["result"]["value"].clone()
    }

    /// The text of the first element that a selector finds.
    pub fn text(&mut self, selector: &str) -> String {
        let text = self.ask(&format!("document.querySelector({})?.innerText", json!(selector)));
        text.as_str().unwrap_or_else(|| panic!("there is no {selector}")).to_owned()
    }

    /// Waits until the page has drawn.
    pub fn settle(&mut self) {
        self.ask("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))");
    }

    /// Clicks into the middle of the first element that a selector finds.
    pub fn click(&mut self, selector: &str) {
        let place = self.ask(&format!(
            "(() => {{ const box = document.querySelector({}).getBoundingClientRect(); return [box.x + box.width / 2, box.y + box.height / 2]; }})()",
            json!(selector)
        ));
        for (what, buttons) in [("mousePressed", 1), ("mouseReleased", 0)] {
            let event = json!({ "type": what, "x": place[0], "y": place[1], "button": "left", "buttons": buttons, "clickCount": 1 });
            self.call("Input.dispatchMouseEvent", event);
        }
        self.settle();
    }

    /// Presses a key: a sign, or the name of a key with its code.
    pub fn key(&mut self, name: &str) {
        let code = match name {
            "ArrowLeft" => 37,
            "ArrowUp" => 38,
            "ArrowRight" => 39,
            "ArrowDown" => 40,
            "Enter" => 13,
            "Escape" => 27,
            "End" => 35,
            "Home" => 36,
            _ => 0,
        };
        let mut event = json!({ "type": "keyDown", "key": name, "windowsVirtualKeyCode": code });
        if name.chars().count() == 1 {
            event["text"] = name.into();
        }
        self.call("Input.dispatchKeyEvent", event.clone());
        event["type"] = "keyUp".into();
        self.call("Input.dispatchKeyEvent", event);
        self.settle();
    }

    /// Gives the page a size, and prefers light or dark.
    pub fn looks(&mut self, width: u32, height: u32, scheme: &str) {
        let size = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false });
        self.call("Emulation.setDeviceMetricsOverride", size);
        let media = json!({ "features": [{ "name": "prefers-color-scheme", "value": scheme }] });
        self.call("Emulation.setEmulatedMedia", media);
        self.settle();
    }

    /// Writes a picture of the page into the folder that the variable ACM_SCREENSHOTS names, if it names one.
    pub fn picture(&mut self, name: &str) {
        let Some(folder) = std::env::var_os("ACM_SCREENSHOTS") else { return };
        self.settle();
        let answer = self.call("Page.captureScreenshot", json!({ "format": "png" }));
        // The decoder of base64 at hand is the browser's own.
        let bytes = self.ask(&format!("Array.from(atob({}), sign => sign.charCodeAt(0))", answer["data"]));
        let bytes: Vec<u8> = serde_json::from_value(bytes).unwrap();
        std::fs::write(Path::new(&folder).join(format!("{name}.png")), bytes).unwrap();
    }

    /// Calls a method of the browser and waits for its answer.
    fn call(&mut self, method: &str, params: Value) -> Value {
        self.last += 1;
        let mut asked = json!({ "id": self.last, "method": method, "params": params });
        if !self.session.is_null() {
            asked["sessionId"] = self.session.clone();
        }
        self.to.write_all(format!("{asked}\0").as_bytes()).unwrap();
        loop {
            let mut told = Vec::new();
            self.from.read_until(0, &mut told).unwrap();
            assert_eq!(told.pop(), Some(0), "the browser is gone");
            let told: Value = serde_json::from_slice(&told).unwrap();
            if told["id"] == self.last {
                assert!(told.get("error").is_none(), "{method}: {}", told["error"]);
                return told["result"].clone();
            }
            self.overhear(&told);
        }
    }

    fn overhear(&mut self, told: &Value) {
        let complaint = match told["method"].as_str() {
            Some("Runtime.exceptionThrown") => told["params"]["exceptionDetails"].to_string(),
            Some("Log.entryAdded") if told["params"]["entry"]["level"] == "error" => {
                told["params"]["entry"].to_string()
            }
            // The page itself and what stands in it are all that may be asked for.
            Some("Network.requestWillBeSent") => {
                let url = told["params"]["request"]["url"].as_str().unwrap_or_default().to_owned();
                let own = url.starts_with("file:") || url.starts_with("data:") || url.starts_with("http://127.0.0.1:");
                if own {
                    return;
                }
                format!("asked for {url}")
            }
            _ => return,
        };
        self.complaints.push(complaint);
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        if self.child.kill().is_ok() {
            self.child.wait().unwrap();
        }
    }
}
