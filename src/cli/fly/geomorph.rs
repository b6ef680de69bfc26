//! `--geomorph`.

use progmesh::selective::Geomorph;

/// Frames that a change takes if nothing is said: a fifth of a second at 60 frames a second, long enough not to be seen as a jump.
const FRAMES: u32 = 12;
/// Tolerances from nothing to all if nothing is said.
const BAND: f64 = 2.0;

/// `time`, `time:FRAMES`, `error` or `error:BAND`.
pub(super) fn parse(text: &str) -> Result<Geomorph, String> {
    let wrong = || "must be time, time:FRAMES (1 or more), error, or error:BAND (more than 1)".to_string();
    let (how, number) = text.split_once(':').map_or((text, None), |(how, number)| (how, Some(number)));
    match how {
        "time" => {
            let frames = number.map_or(Some(FRAMES), |n| n.parse().ok().filter(|&n| n >= 1));
            frames.map(|frames| Geomorph::Time { frames }).ok_or_else(wrong)
        }
        "error" => {
            let band = number.map_or(Some(BAND), |n| n.parse().ok().filter(|&b| b > 1.0 && b <= 1e6));
            band.map(|band| Geomorph::Error { band }).ok_or_else(wrong)
        }
        _ => Err(wrong()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_can_be_said_about_morphs() {
        assert_eq!(parse("time"), Ok(Geomorph::Time { frames: FRAMES }));
        assert_eq!(parse("time:3"), Ok(Geomorph::Time { frames: 3 }));
        assert_eq!(parse("error:1.5"), Ok(Geomorph::Error { band: 1.5 }));
        assert!(
            ["", "time:0", "time:", "error:1", "error:nan", "error:inf", "x"]
                .iter()
                .all(|t| parse(t).is_err())
        );
    }
}
