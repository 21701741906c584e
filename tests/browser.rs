//! A headless Chromium, spoken to over two pipes (the DevTools protocol with `--remote-debugging-pipe`: JSON messages,
//! each ended by a zero byte), and what a page did in it.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tempfile::TempDir;

use crate::harness::HANGS;

/// One browser at a time: they take all there is of the machine.
static ALONE: Mutex<()> = Mutex::new(());

pub(crate) struct Browser {
    process: Child,
    requests: ChildStdin,
    answers: Receiver<Value>,
    session: Option<String>,
    last: u64,
    /// What happened besides answers, since the last page was opened.
    events: Vec<Value>,
    _profile: TempDir,
    _alone: MutexGuard<'static, ()>,
}

impl Browser {
    /// Starts the browser. None, with a word on what is skipped, where it is not installed; a failure where `CI=true`.
    pub(crate) fn start(test: &str) -> Option<Self> {
        let there =
            Command::new("chromium").arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
        if !there.is_ok_and(|status| status.success()) {
            assert_ne!(std::env::var("CI").as_deref(), Ok("true"), "missing: chromium");
            eprintln!("skipped: {test}: chromium is not installed");
            return None;
        }
        let alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        let profile = TempDir::new().expect("there is a place for temporary folders");
        // The browser wants its pipes as descriptors 3 and 4; a shell hands its own 0 and 1 on as these.
        let mut process = Command::new("sh")
            .args(["-c", "exec chromium \"$@\" 3<&0 4>&1 0</dev/null 1>/dev/null 2>/dev/null", "sh"])
            .args([
                "--headless=new",
                "--no-sandbox",
                "--disable-gpu",
                "--disable-dev-shm-usage",
                "--no-first-run",
            ])
            .args(["--disable-background-networking", "--disable-component-update", "--disable-extensions"])
            .args(["--host-resolver-rules=MAP * ~NOTFOUND", "--remote-debugging-pipe"])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("the shell starts");
        let requests = process.stdin.take().expect("a pipe");
        let mut output = BufReader::new(process.stdout.take().expect("a pipe"));
        let (sender, answers) = channel();
        thread::spawn(move || {
            let mut message = Vec::new();
            while output.read_until(0, &mut message).is_ok_and(|read| read > 0) {
                message.pop();
                let value = serde_json::from_slice(&message).expect("a message is JSON");
                if sender.send(value).is_err() {
                    break;
                }
                message.clear();
            }
        });
        let mut browser = Self {
            process,
            requests,
            answers,
            session: None,
            last: 0,
            events: Vec::new(),
            _profile: profile,
            _alone: alone,
        };
        let target = browser.call("Target.createTarget", json!({"url": "about:blank"}));
        let session =
            browser.call("Target.attachToTarget", json!({"targetId": target["targetId"], "flatten": true}));
        browser.session = session["sessionId"].as_str().map(str::to_owned);
        for domain in ["Page", "Runtime", "Log", "Network"] {
            browser.call(&format!("{domain}.enable"), json!({}));
        }
        Some(browser)
    }

    /// Calls a method, and keeps what happens until it answers.
    pub(crate) fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.last += 1;
        let mut message = json!({"id": self.last, "method": method, "params": parameters});
        if let Some(session) = &self.session {
            message["sessionId"] = json!(session);
        }
        let mut bytes = serde_json::to_vec(&message).expect("JSON can be written");
        bytes.push(0);
        self.requests.write_all(&bytes).expect("the browser listens");
        loop {
            let answer = self.answers.recv_timeout(HANGS).expect("the browser answers in time");
            if answer["id"] == json!(self.last) {
                assert!(answer["error"].is_null(), "{method}: {}", answer["error"]);
                return answer["result"].clone();
            }
            self.events.push(answer);
        }
    }

    /// The value of an expression in the page.
    pub(crate) fn value(&mut self, expression: &str) -> Value {
        let parameters = json!({"expression": expression, "returnByValue": true, "awaitPromise": true});
        let answer = self.call("Runtime.evaluate", parameters);
        assert!(answer["exceptionDetails"].is_null(), "{expression}: {}", answer["exceptionDetails"]);
        answer["result"]["value"].clone()
    }

    /// Waits until an expression is true.
    pub(crate) fn wait_for(&mut self, expression: &str) {
        let start = Instant::now();
        while self.value(expression) != json!(true) {
            assert!(start.elapsed() < HANGS, "{expression} does not become true");
            thread::sleep(Duration::from_millis(20));
        }
    }

    /// Opens a page in a window of this width, and waits until all charts are drawn.
    pub(crate) fn open(&mut self, page: &Path, width: u32) {
        self.call("Page.navigate", json!({"url": "about:blank"}));
        let window = json!({"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 600});
        self.call("Emulation.setDeviceMetricsOverride", window);
        self.call("Emulation.setTouchEmulationEnabled", json!({"enabled": width < 600}));
        self.events.clear();
        self.call("Page.navigate", json!({"url": format!("file://{}", page.display())}));
        self.wait_for("performance.getEntriesByName('charts-drawn').length === 1");
    }

    /// The processor time in seconds that the page's thread has taken since it was first asked for: that of others does
    /// not count.
    pub(crate) fn work(&mut self) -> f64 {
        self.call("Performance.enable", json!({"timeDomain": "threadTicks"}));
        let answer = self.call("Performance.getMetrics", json!({}));
        let metrics = answer["metrics"].as_array().expect("a list");
        let own = metrics.iter().find(|metric| metric["name"] == "TaskDuration");
        own.and_then(|metric| metric["value"].as_f64()).expect("a time")
    }

    /// Everything that was written to the console, thrown, or opened as a dialog since the page was opened.
    pub(crate) fn complaints(&mut self) -> Vec<String> {
        // What is on its way arrives before the answer.
        self.value("new Promise((done) => setTimeout(done, 50))");
        let loud = [
            "Runtime.consoleAPICalled",
            "Runtime.exceptionThrown",
            "Log.entryAdded",
            "Page.javascriptDialogOpening",
        ];
        let events = self.events.iter().filter(|event| loud.iter().any(|name| event["method"] == *name));
        events.map(Value::to_string).collect()
    }

    /// The addresses asked for since the page was opened, other than those that carry their content.
    pub(crate) fn addresses(&self) -> Vec<String> {
        let requests = self.events.iter().filter(|event| event["method"] == "Network.requestWillBeSent");
        let addresses = requests.filter_map(|event| event["params"]["request"]["url"].as_str());
        addresses.filter(|address| !address.starts_with("data:")).map(str::to_owned).collect()
    }

    /// Moves the mouse to points of the page, with the button pressed or not; the last one releases it.
    pub(crate) fn mouse(&mut self, points: &[(f64, f64)], pressed: bool) {
        let mut send = |kind: &str, (x, y): (f64, f64), down: bool| {
            let buttons = u8::from(down && kind != "mouseReleased");
            let button = if down { "left" } else { "none" };
            let event =
                json!({"type": kind, "x": x, "y": y, "button": button, "buttons": buttons, "clickCount": 1});
            self.call("Input.dispatchMouseEvent", event);
        };
        for (position, point) in points.iter().enumerate() {
            send("mouseMoved", *point, pressed && position > 0);
            if pressed && position == 0 {
                send("mousePressed", *point, true);
            }
        }
        if let (true, Some(last)) = (pressed, points.last()) {
            send("mouseReleased", *last, true);
        }
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
