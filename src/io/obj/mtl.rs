//! MTL: the materials of an OBJ file, and the textures they name.

use crate::io::Side;
use crate::scene::{Image, Material};
use std::borrow::Cow;
use std::fmt::Write;

/// What MTL statements say of a material, its textures apart.
pub(crate) fn material_of(statements: &str) -> Material {
    Library::default().material(String::new(), statements.to_string(), "", "", &crate::io::NoSide)
}

/// The file that MTL statements name for the base colour.
pub(crate) fn base_texture(statements: &str) -> Option<&str> {
    let named = |line| texture(line).filter(|t| t.0.eq_ignore_ascii_case("map_kd")).map(|t| t.1);
    statements.lines().filter_map(named).next_back()
}

/// Materials and images gathered from all `mtllib` of a file.
#[derive(Default)]
pub(super) struct Library {
    pub(super) materials: Vec<Material>,
    pub(super) images: Vec<Image>,
    pub(super) warnings: Vec<String>,
}

impl Library {
    /// Reads what a `mtllib` statement names: one file, or several separated by blanks. A missing one is a warning.
    pub(super) fn load(&mut self, names: &str, side: &dyn Side) {
        let whole = load(side, names);
        let list = match whole {
            Ok(bytes) => return self.read(&bytes, names, side),
            Err(why) if names.split_whitespace().count() < 2 => vec![(names, Err(why))],
            Err(_) => names.split_whitespace().map(|name| (name, load(side, name))).collect(),
        };
        for (name, bytes) in list {
            match bytes {
                Ok(bytes) => self.read(&bytes, name, side),
                Err(why) => {
                    self.warnings.push(format!("{name} could not be read ({why}): its materials are plain"))
                }
            }
        }
    }

    fn read(&mut self, bytes: &[u8], file: &str, side: &dyn Side) {
        // Textures are named relative to the MTL file.
        let folder = file.rfind(['/', '\\']).map_or("", |cut| &file[..=cut]);
        let text = String::from_utf8_lossy(bytes);
        let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
        let mut sections: Vec<(String, String)> = Vec::new();
        for line in text.split(['\n', '\r']).map(str::trim) {
            let (word, rest) = split_word(line);
            match (word, sections.last_mut()) {
                ("newmtl", _) => sections.push((rest.to_string(), String::new())),
                ("", _) => {}
                (word, _) if word.starts_with('#') => {}
                (_, Some((_, raw))) => {
                    raw.push_str(line);
                    raw.push('\n');
                }
                (_, None) => self.warn(format!("{file}: statements before the first newmtl are left out")),
            }
        }
        for (name, raw) in sections {
            if self.materials.iter().any(|m| m.name == name) {
                self.warn(format!("{file}: material \"{name}\" comes again; the first one holds"));
            } else {
                let material = self.material(name, raw, file, folder, side);
                self.materials.push(material);
            }
        }
    }

    fn warn(&mut self, what: String) {
        // A hostile file may repeat itself without end.
        if self.warnings.len() < 100 && !self.warnings.contains(&what) {
            self.warnings.push(what);
        }
    }

    fn material(&mut self, name: String, raw: String, file: &str, folder: &str, side: &dyn Side) -> Material {
        let parse = |text: &str| {
            let text = text
                .lines()
                .try_fold("newmtl x\n".to_string(), |t, l| Some(t + &three_numbers(l)? + "\n"))?;
            tobj::load_mtl_buf(&mut text.as_bytes()).ok().and_then(|(m, _)| m.into_iter().next())
        };
        let parsed = parse(&raw).or_else(|| {
            // One statement is wrong: leave it out, keep the others.
            let good: String =
                raw.lines().filter(|l| parse(l).is_some()).fold(String::new(), |t, l| t + l + "\n");
            self.warn(format!(
                "{file}: material \"{name}\" has statements that are wrong; they are left out"
            ));
            parse(&good)
        });
        let mut material = Material { name, mtl: Some(raw), ..Default::default() };
        let Some(m) = parsed else { return material };
        let finite = |c: [f32; 3]| c.map(|x| if x.is_finite() { x } else { 0.0 });
        if let Some(kd) = m.diffuse {
            material.base_color[..3].copy_from_slice(&finite(kd));
        }
        let unknown = |key: &str| {
            m.unknown_param.get(key).and_then(|v| v.split_whitespace().next()?.parse::<f32>().ok())
        };
        let alpha = m.dissolve.or_else(|| unknown("Tr").map(|t| 1.0 - t)).filter(|a| a.is_finite());
        material.base_color[3] = alpha.unwrap_or(1.0).clamp(0.0, 1.0);
        material.emissive = finite(m.emissive.unwrap_or_default());
        material.metallic = unknown("Pm").filter(|x| x.is_finite()).unwrap_or(0.0).clamp(0.0, 1.0);
        let from_shininess = m.shininess.filter(|&n| n >= 0.0).map(|n| (2.0 / (n + 2.0)).sqrt());
        material.roughness =
            unknown("Pr").or(from_shininess).filter(|r| r.is_finite()).unwrap_or(1.0).clamp(0.0, 1.0);
        // Every texture is loaded, so that the raw statements can be written again with their files.
        let statements = material.mtl.clone().unwrap_or_default();
        for (word, texture) in statements.lines().filter_map(texture) {
            let image = self.image(texture, folder, side);
            match word.to_ascii_lowercase().as_str() {
                "map_kd" => material.base_color_image = Some(image),
                "norm" => material.normal_image = Some(image),
                _ => {}
            }
        }
        material
    }

    fn image(&mut self, name: &str, folder: &str, side: &dyn Side) -> usize {
        if let Some(known) = self.images.iter().position(|i| i.uri.as_deref() == Some(name)) {
            return known;
        }
        let found = match folder {
            "" => load(side, name),
            _ => load(side, &format!("{folder}{name}")).or_else(|_| load(side, name)),
        };
        let data = match found {
            Ok(bytes) => Some(bytes),
            Err(why) => {
                self.warn(format!("texture {name} could not be read ({why})"));
                None
            }
        };
        let mime = mime_of(name, data.as_deref());
        self.images.push(Image { name: None, uri: Some(name.to_string()), mime, data });
        self.images.len() - 1
    }
}

/// A colour statement with all its three numbers: tobj panics on fewer. One alone stands for all, as the format says; two are wrong.
fn three_numbers(line: &str) -> Option<Cow<'_, str>> {
    let mut words = line.split_whitespace();
    if !matches!(words.next(), Some("Ka" | "Kd" | "Ks" | "Ke")) {
        return Some(line.into());
    }
    match (words.next(), words.next(), words.next()) {
        (Some(_), Some(_), Some(_)) => Some(line.into()),
        (Some(gray), None, None) => Some(format!("{line} {gray} {gray}").into()),
        _ => None,
    }
}

/// Loads a file by the name written, or with the other kind of slash.
fn load(side: &dyn Side, name: &str) -> Result<Vec<u8>, String> {
    let result = side.load(name);
    let result =
        if name.contains('\\') { result.or_else(|_| side.load(&name.replace('\\', "/"))) } else { result };
    result.map_err(|e| e.to_string())
}

/// The first word of a line and the rest, trimmed.
fn split_word(line: &str) -> (&str, &str) {
    match line.find(char::is_whitespace) {
        Some(cut) => (&line[..cut], line[cut..].trim()),
        None => (line, ""),
    }
}

/// A statement that names a texture: its keyword and the file name, options skipped.
fn texture(line: &str) -> Option<(&str, &str)> {
    let (word, mut rest) = split_word(line);
    let lower = word.to_ascii_lowercase();
    if !(lower.starts_with("map_") && lower != "map_aat"
        || ["bump", "disp", "decal", "norm", "refl"].contains(&lower.as_str()))
    {
        return None;
    }
    while rest.starts_with('-') {
        let (option, after) = split_word(rest);
        // How many words may follow an option; those of -o, -s, -t are one to three numbers.
        let (least, most) = match option {
            "-o" | "-s" | "-t" => (1, 3),
            "-mm" => (2, 2),
            "-blendu" | "-blendv" | "-cc" | "-clamp" | "-imfchan" | "-texres" | "-type" | "-bm"
            | "-boost" | "-colorspace" => (1, 1),
            _ => break,
        };
        rest = after;
        for k in 0..most {
            let (value, after) = split_word(rest);
            if k >= least && value.parse::<f32>().is_err() {
                break;
            }
            rest = after;
        }
    }
    (!rest.is_empty()).then_some((word, rest))
}

/// The media type, by the first bytes, else by the extension.
pub(crate) fn mime_of(name: &str, data: Option<&[u8]>) -> Option<String> {
    let by_bytes = match data.unwrap_or(&[]) {
        [0x89, b'P', b'N', b'G', ..] => Some("image/png"),
        [0xff, 0xd8, 0xff, ..] => Some("image/jpeg"),
        _ => None,
    };
    let by_name = || match name.rsplit_once('.')?.1.to_ascii_lowercase().as_str() {
        "png" => Some("image/png"),
        "jpg" | "jpeg" => Some("image/jpeg"),
        "bmp" => Some("image/bmp"),
        "tga" => Some("image/x-tga"),
        "tif" | "tiff" => Some("image/tiff"),
        "webp" => Some("image/webp"),
        _ => None,
    };
    by_bytes.or_else(by_name).map(str::to_string)
}

/// Names under which images are written beside the file: never absolute, never up a folder, each once.
pub(crate) fn image_names(images: &[Image], stem: &str) -> Vec<String> {
    let mut names: Vec<String> = Vec::with_capacity(images.len());
    let mut taken = std::collections::BTreeSet::new();
    for (i, image) in images.iter().enumerate() {
        let given =
            image.uri.as_deref().filter(|u| !u.starts_with("data:")).or(image.name.as_deref()).unwrap_or("");
        let given = given.replace('\\', "/");
        let unsafe_path =
            given.starts_with('/') || given.contains(':') || given.split('/').any(|p| p == "..");
        let path =
            if unsafe_path { given.rsplit('/').next().unwrap_or("") } else { given.trim_start_matches("./") };
        let mut path: String =
            path.chars().map(|c| if c.is_control() || c == ':' { '_' } else { c }).collect();
        path = path.trim().to_string();
        if path.is_empty() || path == "." || path == ".." || path.ends_with('/') || path.starts_with('-') {
            path = format!("{stem}_{i}");
        }
        let extension = match image.mime.as_deref() {
            Some("image/jpeg") => "jpg",
            Some("image/webp") => "webp",
            _ => "png",
        };
        let last = path.rsplit('/').next().unwrap_or("");
        if !last.contains('.') {
            let _ = write!(path, ".{extension}");
        }
        let mut name = path.clone();
        let mut k = 1;
        while !taken.insert(name.clone()) {
            let cut = path.rfind('.').unwrap_or(path.len());
            name = format!("{}_{k}{}", &path[..cut], &path[cut..]);
            k += 1;
        }
        names.push(name);
    }
    names
}

/// The text of a material library. `names` are those the materials go by, `images` those of [`image_names`].
pub(super) fn write(
    materials: &[Material],
    names: &[String],
    images: &[Image],
    image_names: &[String],
) -> String {
    let mut out = String::new();
    for (m, name) in materials.iter().zip(names) {
        let _ = writeln!(out, "newmtl {name}");
        match &m.mtl {
            Some(raw) => write_raw(&mut out, raw, images, image_names),
            None => write_fields(&mut out, m, image_names),
        }
        out.push('\n');
    }
    out
}

/// Writes statements as they were read; only the names of textures follow their files.
fn write_raw(out: &mut String, raw: &str, images: &[Image], names: &[String]) {
    for line in
        raw.split(['\n', '\r']).map(str::trim).filter(|l| !l.is_empty() && split_word(l).0 != "newmtl")
    {
        let renamed = texture(line).and_then(|(_, file)| {
            // The file's name, or what is left of it where the image lay inside a file of another format.
            let is = |name: &Option<String>| name.as_deref() == Some(file);
            let i = images
                .iter()
                .position(|image| image.data.is_some() && (is(&image.uri) || is(&image.name)))?;
            Some(format!("{}{}", &line[..line.len() - file.len()], names[i]))
        });
        out.push_str(renamed.as_deref().unwrap_or(line));
        out.push('\n');
    }
}

fn write_fields(out: &mut String, m: &Material, names: &[String]) {
    let [r, g, b, a] = m.base_color;
    let _ = writeln!(out, "Kd {r} {g} {b}\nd {a}");
    if m.emissive != [0.0; 3] {
        let [r, g, b] = m.emissive;
        let _ = writeln!(out, "Ke {r} {g} {b}");
    }
    // Both the classic exponent and the physically based extension.
    let shininess = (2.0 / m.roughness.clamp(0.03, 1.0).powi(2) - 2.0).clamp(0.0, 1000.0);
    let _ = writeln!(out, "Ns {shininess}\nPm {}\nPr {}\nillum 2", m.metallic, m.roughness);
    for (word, image) in [("map_Kd", m.base_color_image), ("norm", m.normal_image)] {
        if let Some(name) = image.and_then(|i| names.get(i)) {
            let _ = writeln!(out, "{word} {name}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texture_options_are_skipped() {
        assert_eq!(texture("map_Kd -s 1 1 1 -o 0.5 my tex.png"), Some(("map_Kd", "my tex.png")));
        assert_eq!(texture("bump -bm 0.2 b.png"), Some(("bump", "b.png")));
        assert_eq!(texture("map_Kd -clamp on 1.png"), Some(("map_Kd", "1.png")));
        assert_eq!(texture("map_Kd"), None);
        assert_eq!(texture("Kd 1 1 1"), None);
    }

    #[test]
    fn colours_of_one_number_are_gray_and_of_two_are_wrong() {
        assert_eq!(three_numbers("Kd 0.5").as_deref(), Some("Kd 0.5 0.5 0.5"));
        assert_eq!(three_numbers("Kd 0.5 1").as_deref(), None);
        assert_eq!(three_numbers("Ks").as_deref(), None);
        assert_eq!(three_numbers("d 1").as_deref(), Some("d 1"));
    }

    #[test]
    fn image_names_stay_beside_the_file() {
        let image = |uri: &str| Image { uri: Some(uri.into()), ..Default::default() };
        let images = [
            "a.png",
            "../../b.png",
            "/etc/c.png",
            "C:\\d\\e.png",
            "sub\\f.png",
            "data:image/png;base64,AA",
            "./a.png",
            "..",
        ];
        let names = image_names(&images.map(image), "out");
        assert_eq!(
            names,
            ["a.png", "b.png", "c.png", "e.png", "sub/f.png", "out_5.png", "a_1.png", "out_7.png"]
        );
    }
}
