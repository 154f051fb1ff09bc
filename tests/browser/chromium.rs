//! A headless Chromium, driven over its debugging socket.

use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use serde_json::{Value, json};
use tungstenite::{Message, WebSocket};

use crate::harness::WATCHDOG;

/// A browser with one page; killed when dropped.
pub(crate) struct Chromium {
    child: Child,
    socket: WebSocket<TcpStream>,
    session: String,
    asked: u64,
    _profile: tempfile::TempDir,
}

impl Chromium {
    /// Starts the browser; `None` when it is not installed.
    pub(crate) fn start() -> Option<Self> {
        let profile = tempfile::tempdir().unwrap();
        let mut command = Command::new("chromium");
        // Containers seldom let a browser build its sandbox; it sees this test's page only.
        command.args([
            "--headless=new",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-dev-shm-usage",
            "--no-first-run",
            "--remote-debugging-port=0",
        ]);
        command.arg(format!("--user-data-dir={}", profile.path().display())).arg("about:blank");
        let mut child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().ok()?;
        let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map_while(Result::ok);
        let address = lines.find_map(|line| line.strip_prefix("DevTools listening on ").map(str::to_owned)).expect("its debugging address");
        // Its later output is discarded, so that it never blocks on the pipe.
        std::thread::spawn(move || lines.for_each(drop));
        let host = address.trim_start_matches("ws://").split('/').next().unwrap().to_owned();
        let stream = TcpStream::connect(host).unwrap();
        stream.set_read_timeout(Some(WATCHDOG)).unwrap();
        let (socket, _) = tungstenite::client(address, stream).unwrap();
        let mut browser = Self { child, socket, session: String::new(), asked: 0, _profile: profile };
        let target = browser.ask("Target.createTarget", json!({ "url": "about:blank" }));
        let session = browser.ask("Target.attachToTarget", json!({ "targetId": target["targetId"], "flatten": true }));
        browser.session = session["sessionId"].as_str().unwrap().to_owned();
        Some(browser)
    }

    /// Opens a page.
    pub(crate) fn open(&mut self, url: &str) {
        self.ask("Page.enable", json!({}));
        let answer = self.ask("Page.navigate", json!({ "url": url }));
        assert!(answer.get("errorText").is_none(), "{answer}");
        self.wait("document.readyState === 'complete' && window.stillmap");
    }

    /// Waits until an expression of the page holds.
    pub(crate) fn wait(&mut self, condition: &str) {
        let until = format!(
            "new Promise(done => {{ const look = () => {{ let holds = false; try {{ holds = {condition}; }} catch {{}} \
             if (holds) done(true); else setTimeout(look, 30); }}; look(); }})"
        );
        // A page that is being replaced drops its promises.
        while self.evaluate(&until) != Value::Bool(true) {}
    }

    pub(crate) fn run(&mut self, script: &str) {
        self.evaluate(&format!("(async () => {{ {script}; return 0; }})()"));
    }

    pub(crate) fn number(&mut self, expression: &str) -> f64 {
        self.evaluate(expression).as_f64().unwrap()
    }

    pub(crate) fn text(&mut self, expression: &str) -> String {
        self.evaluate(expression).as_str().unwrap().to_owned()
    }

    /// Sets the size of the page, px.
    pub(crate) fn screen(&mut self, width: u32, height: u32) {
        let is_phone = width < 600;
        self.ask(
            "Emulation.setDeviceMetricsOverride",
            json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": is_phone }),
        );
    }

    /// Saves a screenshot of the whole page.
    pub(crate) fn screenshot(&mut self, path: &Path) {
        let answer = self.ask("Page.captureScreenshot", json!({ "format": "png", "captureBeyondViewport": true }));
        let png = data_encoding::BASE64.decode(answer["data"].as_str().unwrap().as_bytes()).unwrap();
        std::fs::write(path, png).unwrap();
    }

    fn evaluate(&mut self, expression: &str) -> Value {
        let answer = self.ask("Runtime.evaluate", json!({ "expression": expression, "awaitPromise": true, "returnByValue": true }));
        assert!(answer.get("exceptionDetails").is_none(), "{expression}: {answer}");
        answer["result"]["value"].clone()
    }

    fn ask(&mut self, method: &str, parameters: Value) -> Value {
        self.asked += 1;
        let mut request = json!({ "id": self.asked, "method": method, "params": parameters });
        if !self.session.is_empty() {
            request["sessionId"] = json!(self.session);
        }
        self.socket.send(Message::text(request.to_string())).unwrap();
        loop {
            let Message::Text(answer) = self.socket.read().expect("an answer before the watchdog") else { continue };
            let answer: Value = serde_json::from_str(&answer).unwrap();
            if answer["id"] == self.asked {
                assert!(answer.get("error").is_none() || method == "Runtime.evaluate", "{method}: {answer}");
                return answer["result"].clone();
            }
        }
    }
}

impl Drop for Chromium {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
