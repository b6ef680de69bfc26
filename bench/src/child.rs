//! One run of a tool in a process of its own.

use crate::one::Said;
use crate::tools::{Host, Places, Tool};
use anyhow::{Context, Result};
use std::io::Read;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

/// What a run cost.
#[derive(Clone, Debug)]
pub(crate) struct Cost {
    pub(crate) said: Said,
    /// Seconds from starting the process to its end: loading, reading the raw mesh, the call, writing the raw mesh.
    pub(crate) process_seconds: f64,
    /// Processor seconds of all its threads; `None` where the system does not say.
    pub(crate) cpu_seconds: Option<f64>,
}

/// What to run.
pub(crate) struct Job<'a> {
    pub(crate) tool: &'a Tool,
    pub(crate) threads: usize,
    pub(crate) input: &'a Path,
    pub(crate) output: &'a Path,
    pub(crate) target: usize,
    pub(crate) parameter: Option<f64>,
    pub(crate) limit: Duration,
}

impl Job<'_> {
    fn command(&self, places: &Places) -> Result<Command> {
        let mut command = match self.tool.host {
            Host::Rust => {
                let mut c = Command::new(std::env::current_exe().context("this program")?);
                c.args(["one", self.tool.id]);
                c
            }
            Host::Python => {
                let mut c = Command::new(places.python());
                c.arg(places.bench.join("peers/simplify.py")).arg(self.tool.id);
                c
            }
            Host::Cgal => {
                let mut c = Command::new(places.cgal());
                c.arg(self.tool.id.trim_start_matches("cgal-"));
                c
            }
        };
        command.arg(self.input).arg(self.output).arg(self.target.to_string());
        command.args(self.parameter.map(|p| p.to_string()));
        if self.tool.ours {
            command.env("RAYON_NUM_THREADS", self.threads.to_string());
        }
        Ok(command)
    }

    /// Runs it. The inner error is the tool's own failure, in its words.
    pub(crate) fn run(&self, places: &Places) -> Result<Result<Cost, String>> {
        let mut command = self.command(places)?;
        let cpu = children_cpu();
        let start = Instant::now();
        let mut child = command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .with_context(|| format!("starting {}", self.tool.name))?;
        let streams = (drain(child.stdout.take()), drain(child.stderr.take()));
        let status = loop {
            if let Some(status) = child.try_wait()? {
                break Some(status);
            }
            if start.elapsed() > self.limit {
                child.kill()?;
                child.wait()?;
                break None;
            }
            // Fine enough for short runs, and no load on the cores that are being measured.
            let pause = if start.elapsed() < Duration::from_millis(200) { 200 } else { 2000 };
            thread::sleep(Duration::from_micros(pause));
        };
        let process_seconds = start.elapsed().as_secs_f64();
        let cpu_seconds = cpu.and_then(|before| Some(children_cpu()? - before));
        let (out, err) = (streams.0.join().unwrap_or_default(), streams.1.join().unwrap_or_default());
        let Some(status) = status else {
            return Ok(Err(format!("not done after {} s", self.limit.as_secs())));
        };
        if !status.success() {
            let words = err.lines().map(str::trim).rfind(|l| !l.is_empty()).unwrap_or_default();
            return Ok(Err(match words {
                "" => status.to_string(),
                words => words.chars().take(200).collect(),
            }));
        }
        // Libraries may print too; ours is the last line.
        let line = out.lines().rfind(|l| l.starts_with('{')).unwrap_or_default();
        match serde_json::from_str(line) {
            Ok(said) => Ok(Ok(Cost { said, process_seconds, cpu_seconds })),
            Err(e) => Ok(Err(format!("its answer makes no sense: {e}"))),
        }
    }
}

/// Reads a stream to its end, so that the child never waits for us.
fn drain(stream: Option<impl Read + Send + 'static>) -> thread::JoinHandle<String> {
    thread::spawn(move || {
        let mut bytes = Vec::new();
        if let Some(mut s) = stream {
            // What was read before an error still counts.
            let _ = s.read_to_end(&mut bytes);
        }
        String::from_utf8_lossy(&bytes).into_owned()
    })
}

/// Processor seconds of all children that have ended. Linux counts them in hundredths.
fn children_cpu() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // Fields 16 and 17; the second may hold spaces, in parentheses.
    let mut rest = stat.rsplit_once(')')?.1.split_whitespace().skip(13);
    let mut next = || rest.next()?.parse::<f64>().ok();
    Some((next()? + next()?) / 100.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cpu_time_of_children_is_known_on_linux() {
        assert_eq!(children_cpu().is_some(), cfg!(target_os = "linux"));
    }
}
