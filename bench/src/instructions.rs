//! `bench/run --instructions`: how many instructions the kernels take, counted by valgrind: a change of 2 % shows however busy the machine is.

use crate::kernels;
use crate::table::thousands;
use anyhow::{Context, Result, bail, ensure};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

/// Those that are counted.
pub(crate) const COUNTED: [&str; 4] = ["build", "collapse-exact", "split", "distance"];
/// A change from here on is pointed out.
const NOTABLE: f64 = 0.02;
const FACES: usize = 10_000;

/// Runs a kernel once, in the function that valgrind looks for.
pub(crate) fn run_kernel(name: &str) -> Result<usize> {
    let kernels = kernels::all(FACES);
    let kernel =
        kernels.iter().find(|k| k.name == name).with_context(|| format!("no kernel is called {name}"))?;
    Ok(counted_part(kernel.prepare()))
}

#[inline(never)]
fn counted_part(work: kernels::Work) -> usize {
    std::hint::black_box(work())
}

/// Counts all, prints them beside those of the file, and writes them there. False if one has grown by 2 % or more.
pub(crate) fn count(file: &Path, scratch: &Path) -> Result<bool> {
    let before: BTreeMap<String, u64> = match std::fs::read_to_string(file) {
        Ok(text) => serde_json::from_str(&text).with_context(|| file.display().to_string())?,
        Err(_) => BTreeMap::new(),
    };
    let mut now = BTreeMap::new();
    let mut good = true;
    println!("{:<16} {:>16} {:>12}  change", "kernel", "instructions", "an element");
    for kernel in kernels::all(FACES).iter().filter(|k| COUNTED.contains(&k.name)) {
        let name = kernel.name;
        let n = callgrind(name, scratch)?;
        let (change, grown) = change(before.get(name).copied(), n);
        let each = n as f64 / kernel.elements.max(1) as f64;
        println!("{name:<16} {:>16} {each:>12.1}  {change}", thousands(n as usize));
        good &= !grown;
        now.insert(name, n);
    }
    std::fs::write(file, serde_json::to_string_pretty(&now)? + "\n")
        .with_context(|| file.display().to_string())?;
    Ok(good)
}

/// In words, and whether it is a growth to look at.
fn change(before: Option<u64>, now: u64) -> (String, bool) {
    let Some(before) = before.filter(|&b| b > 0) else { return ("new".into(), false) };
    let part = now as f64 / before as f64 - 1.0;
    let mark = if part.abs() >= NOTABLE { " !" } else { "" };
    (format!("{:+.2} %{mark}", 100.0 * part), part >= NOTABLE)
}

fn callgrind(kernel: &str, scratch: &Path) -> Result<u64> {
    let out = scratch.join("callgrind.out");
    let done = Command::new("valgrind")
        .args(["--tool=callgrind", "--toggle-collect=*counted_part*"])
        .arg(format!("--callgrind-out-file={}", out.display()))
        .arg(std::env::current_exe()?)
        .args(["kernel", kernel])
        // One thread takes the same instructions every time.
        .env("RAYON_NUM_THREADS", "1")
        .output()
        .context("valgrind (Debian: apt-get install valgrind)")?;
    let words = String::from_utf8_lossy(&done.stderr).into_owned();
    ensure!(done.status.success(), "valgrind: {words}");
    let text = std::fs::read_to_string(&out).with_context(|| out.display().to_string())?;
    match total(&text) {
        Some(n) if n > 0 => Ok(n),
        _ => bail!("valgrind counted nothing: {words}"),
    }
}

/// What a file of callgrind's says altogether.
fn total(text: &str) -> Option<u64> {
    let line = text.lines().find_map(|l| l.strip_prefix("totals:").or(l.strip_prefix("summary:")))?;
    line.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_from_two_per_cent_on_are_pointed_out() {
        assert_eq!(change(None, 5), ("new".into(), false));
        assert_eq!(change(Some(10_000), 10_190), ("+1.90 %".into(), false));
        assert_eq!(change(Some(10_000), 10_200), ("+2.00 % !".into(), true));
        assert_eq!(change(Some(10_000), 9_700), ("-3.00 % !".into(), false));
    }

    #[test]
    fn the_total_is_read() {
        assert_eq!(total("version: 1\nevents: Ir\nsummary: 1234\n"), Some(1234));
        assert_eq!(total("fn=(1)\n1 2\ntotals: 99 1\n"), Some(99));
        assert_eq!(total("events: Ir\n"), None);
    }

    #[test]
    fn every_kernel_does_its_work_again_and_again() {
        let kernels = kernels::all(1000);
        let names: Vec<&str> = kernels.iter().map(|k| k.name).collect();
        let want = ["build", "collapse", "collapse-exact", "split", "distance", "parse-obj", "parse-ply"];
        assert_eq!(names, want);
        for k in &kernels {
            let counts = [k.prepare()(), k.prepare()()];
            assert!(counts[0] > 0 && counts[0] == counts[1] && k.elements > 0, "{}: {counts:?}", k.name);
        }
    }

    #[test]
    fn what_is_counted_exists() {
        assert!(COUNTED.iter().all(|name| run_kernel(name).unwrap() > 0));
        assert!(run_kernel("none").is_err());
    }
}
