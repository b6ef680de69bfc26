//! The least tolerance with which something fits.

/// Halvings of the interval of tolerances: to a millionth.
const HALVINGS: u32 = 24;

/// The least tolerance from `tau` on of which `fits` says so, the last that it was asked about; infinite if there is none.
///
/// Errors: those of `fits`.
pub(super) fn least<E>(tau: f64, mut fits: impl FnMut(f64) -> Result<bool, E>) -> Result<f64, E> {
    if fits(tau)? {
        return Ok(tau);
    }
    let (mut low, mut high) = (tau, tau.max(1e-3));
    loop {
        high *= 2.0;
        if fits(high)? || high.is_infinite() {
            break;
        }
        low = high;
    }
    for _ in 0..if high.is_finite() { HALVINGS } else { 0 } {
        let middle = 0.5 * (low + high);
        *if fits(middle)? { &mut high } else { &mut low } = middle;
    }
    fits(high)?;
    Ok(high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_is_found_from_above() {
        let at = |least: f64| {
            let mut last = 0.0;
            let found = super::least(0.5, |t| {
                last = t;
                Ok::<bool, ()>(t >= least)
            });
            let found = found.unwrap();
            assert_eq!(found, last);
            found
        };
        assert_eq!(at(0.25), 0.5);
        assert!(at(7.3) >= 7.3 && at(7.3) < 7.3 + 1e-5);
        assert_eq!(at(f64::INFINITY), f64::INFINITY);
        assert_eq!(least(1.0, |_| Err::<bool, &str>("no")), Err("no"));
    }
}
