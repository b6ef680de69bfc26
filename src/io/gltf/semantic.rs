//! Names of attributes: `TEXCOORD_0` and what it means.

use crate::aif::Semantic;

/// The meaning of an attribute's name; `POSITION` is none of them.
pub(super) fn parse(name: &str) -> Semantic {
    let numbered = || -> Option<Semantic> {
        let (base, set) = name.rsplit_once('_')?;
        // "01" and "+1" parse as numbers but are other names.
        let k: u8 = set.parse().ok().filter(|k: &u8| k.to_string() == set)?;
        Some(match base {
            "TEXCOORD" => Semantic::TexCoord(k),
            "COLOR" => Semantic::Color(k),
            "JOINTS" => Semantic::Joints(k),
            "WEIGHTS" => Semantic::Weights(k),
            _ => return None,
        })
    };
    match name {
        "NORMAL" => Semantic::Normal,
        "TANGENT" => Semantic::Tangent,
        _ => numbered().unwrap_or_else(|| Semantic::Custom(name.to_string())),
    }
}

/// The meaning of a morph target's attribute; `None` for those that are not carried (texture coordinates, colours).
pub(super) fn parse_target(name: &str, target: u16) -> Option<Semantic> {
    Some(match name {
        "POSITION" => Semantic::MorphPosition(target),
        "NORMAL" => Semantic::MorphNormal(target),
        "TANGENT" => Semantic::MorphTangent(target),
        _ => return None,
    })
}

/// The attribute's name, and the morph target it belongs to. Names of our own begin with `_`, as the format asks.
pub(super) fn name(semantic: &Semantic) -> (String, Option<u16>) {
    match semantic {
        Semantic::Normal => ("NORMAL".into(), None),
        Semantic::Tangent => ("TANGENT".into(), None),
        Semantic::TexCoord(k) => (format!("TEXCOORD_{k}"), None),
        Semantic::Color(k) => (format!("COLOR_{k}"), None),
        Semantic::Joints(k) => (format!("JOINTS_{k}"), None),
        Semantic::Weights(k) => (format!("WEIGHTS_{k}"), None),
        Semantic::MorphPosition(k) => ("POSITION".into(), Some(*k)),
        Semantic::MorphNormal(k) => ("NORMAL".into(), Some(*k)),
        Semantic::MorphTangent(k) => ("TANGENT".into(), Some(*k)),
        Semantic::Custom(n) if n.starts_with('_') => (n.clone(), None),
        Semantic::Custom(n) => {
            (format!("_{}", n.to_uppercase().replace(|c: char| !c.is_alphanumeric(), "_")), None)
        }
    }
}

/// Numbers an attribute may have; `None` if any.
pub(super) fn widths(semantic: &Semantic) -> Option<&'static [usize]> {
    Some(match semantic {
        Semantic::Normal
        | Semantic::MorphPosition(_)
        | Semantic::MorphNormal(_)
        | Semantic::MorphTangent(_) => &[3],
        Semantic::Tangent | Semantic::Joints(_) | Semantic::Weights(_) => &[4],
        Semantic::TexCoord(_) => &[2],
        Semantic::Color(_) => &[3, 4],
        Semantic::Custom(_) => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_come_back() {
        for n in ["NORMAL", "TANGENT", "TEXCOORD_0", "COLOR_1", "JOINTS_0", "WEIGHTS_3", "_TEMPERATURE"] {
            assert_eq!(name(&parse(n)), (n.to_string(), None));
        }
        assert_eq!(name(&parse_target("NORMAL", 2).unwrap()), ("NORMAL".to_string(), Some(2)));
        assert_eq!(parse_target("TEXCOORD_0", 0), None);
    }

    #[test]
    fn what_is_no_set_number_is_a_name_of_its_own() {
        for n in ["TEXCOORD_01", "TEXCOORD_300", "COLOR_+1", "JOINTS"] {
            assert_eq!(parse(n), Semantic::Custom(n.into()));
        }
        assert_eq!(name(&Semantic::Custom("Quality 1".into())).0, "_QUALITY_1");
    }
}
