//! Materials and images: from a document to the scene, and images back into a file or beside it.

use super::accessor::Store;
use super::container::{data_uri, is_remote, load, percent};
use super::json::{At, array_of};
use super::writer::{Writer, percent_encode};
use crate::io::{DecodeError, Side, obj};
use crate::scene::{Image, Material, Scene};
use serde_json::{Map, Value, json};

/// Where a material's MTL statements are kept in its `extras`, so that OBJ can be written again as it was.
pub(super) const MTL: &str = "mtl";

/// The part of a material that a scene holds.
pub(super) fn material(root: &At<'_>, at: &At<'_>, images: usize) -> Result<Material, DecodeError> {
    let base = at.get("pbrMetallicRoughness");
    let number = |key: &str, default: f64| base.as_ref().map_or(Ok(default), |b| b.number_or(key, default));
    let color: Option<[f64; 4]> = base.as_ref().map_or(Ok(None), |b| b.numbers("baseColorFactor"))?;
    let strength = match at.extension("KHR_materials_emissive_strength") {
        Some(e) => e.number_or("emissiveStrength", 1.0)?,
        None => 1.0,
    };
    let emissive: [f64; 3] = at.numbers("emissiveFactor")?.unwrap_or([0.0; 3]);
    let base_image = match base.as_ref().and_then(|b| b.get("baseColorTexture")) {
        Some(t) => image_of(root, &t, images)?,
        None => None,
    };
    let normal_image = match at.get("normalTexture") {
        Some(t) => image_of(root, &t, images)?,
        None => None,
    };
    let mut material = Material {
        name: at.name().unwrap_or_default(),
        base_color: color.map_or([1.0; 4], |c| c.map(|x| x as f32)),
        base_color_image: base_image,
        normal_image,
        metallic: number("metallicFactor", 1.0)? as f32,
        roughness: number("roughnessFactor", 1.0)? as f32,
        emissive: emissive.map(|x| (x * strength) as f32),
        double_sided: at.get("doubleSided").is_some_and(|v| v.value.as_bool() == Some(true)),
        mtl: None,
    };
    let statements =
        at.get("extras").and_then(|e| e.get(MTL)).and_then(|m| m.value.as_str().map(String::from));
    material.mtl = statements.filter(|text| still_says(text, &material));
    Ok(material)
}

/// Forgets MTL statements that name another texture than the document does.
pub(super) fn check_textures(materials: &mut [Material], images: &[Image]) {
    for m in materials {
        let Some(file) = m.mtl.as_deref().map(obj::base_texture) else { continue };
        let named = |i: &Image| file.is_some() && (i.name.as_deref() == file || i.uri.as_deref() == file);
        // One that glTF cannot hold was left out when the file was written.
        if images.iter().position(named) != m.base_color_image {
            m.mtl = None;
        }
    }
}

/// True if MTL statements say of a material what its document says: nobody has changed it since they were kept.
fn still_says(mtl: &str, material: &Material) -> bool {
    let said = obj::material_of(mtl);
    let near = |a: f32, b: f32| (a - b).abs() <= 1e-5 * a.abs().max(1.0);
    let unit = |x: f32| x.clamp(0.0, 1.0);
    said.base_color.iter().zip(material.base_color).all(|(&a, b)| near(unit(a), b))
        && said.emissive.iter().zip(material.emissive).all(|(&a, b)| near(a.max(0.0), b))
        && near(said.metallic, material.metallic)
        && near(said.roughness, material.roughness)
}

/// The image of a texture reference: the texture's own, or one in a format that an extension adds.
fn image_of(root: &At<'_>, reference: &At<'_>, images: usize) -> Result<Option<usize>, DecodeError> {
    let textures = root.list("textures")?;
    let texture = &textures[reference.need("index")?.as_index(textures.len(), "textures")?];
    if let Some(i) = texture.index("source", images, "images")? {
        return Ok(Some(i));
    }
    for name in ["EXT_texture_webp", "EXT_texture_avif"] {
        if let Some(e) = texture.extension(name) {
            return e.index("source", images, "images");
        }
    }
    Ok(None)
}

/// All images, with their bytes where they can be found.
pub(super) fn images(
    root: &At<'_>,
    store: &Store<'_>,
    side: &dyn Side,
    warnings: &mut Vec<String>,
) -> Result<Vec<Image>, DecodeError> {
    let mut out = Vec::new();
    for at in root.list("images")? {
        let mut image = Image { name: at.name(), ..Default::default() };
        image.mime = at.get("mimeType").map(|m| m.string().map(String::from)).transpose()?;
        if let Some(v) = at.index("bufferView", store.views.len(), "buffer views")? {
            let bytes = store.view(v)?;
            store.budget.take(bytes.range.len(), &at.path)?;
            image.data = Some(bytes.slice().to_vec());
        } else if let Some(uri) = at.get("uri") {
            let text = uri.string()?;
            match data_uri(text) {
                Some(data) => {
                    let (mime, data) = data.map_err(|why| uri.bad(why))?;
                    image.mime = image.mime.or(Some(mime).filter(|m| !m.is_empty()));
                    image.data = Some(data);
                }
                None => {
                    // As a path; the document keeps it as it is written.
                    let path = || String::from_utf8_lossy(&percent(text)).into_owned();
                    image.uri = Some(if is_remote(text) { text.to_string() } else { path() });
                    match load(side, text) {
                        Ok(data) => {
                            store.budget.take(data.len(), &at.path)?;
                            image.data = Some(data);
                        }
                        Err(_) if is_remote(text) => {}
                        Err(e) => warnings.push(format!("{}: image {e}", at.path)),
                    }
                }
            }
        }
        if image.mime.is_none() {
            image.mime = image.data.as_deref().and_then(sniff).map(String::from);
        }
        out.push(image);
    }
    Ok(out)
}

/// The media type of an image, by its first bytes.
pub(super) fn sniff(data: &[u8]) -> Option<&'static str> {
    match data {
        [0x89, b'P', b'N', b'G', ..] => Some("image/png"),
        [0xff, 0xd8, 0xff, ..] => Some("image/jpeg"),
        [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'E', b'B', b'P', ..] => Some("image/webp"),
        _ => None,
    }
}

/// Images and textures of a document that is made anew.
#[derive(Default)]
pub(super) struct Textures {
    pub(super) images: Vec<Value>,
    pub(super) textures: Vec<Value>,
    /// Image of the scene -> texture.
    by_image: Vec<Option<usize>>,
}

impl Textures {
    pub(super) fn of_image(&self, image: usize) -> Option<usize> {
        self.by_image.get(image).copied().flatten()
    }
}

/// Puts a scene's images into the file, or beside it for `.gltf`. Core glTF holds PNG and JPEG only.
pub(super) fn embed(scene: &Scene, writer: &mut Writer) -> Textures {
    let mut out = Textures::default();
    for (i, image) in scene.images.iter().enumerate() {
        let label = image.uri.as_deref().or(image.name.as_deref()).map_or(format!("image {i}"), String::from);
        let mut json = Map::new();
        // A file's name is kept, for the formats that write images beside them.
        if let Some(name) = image.name.as_ref().or(image.uri.as_ref().filter(|u| !u.starts_with("data:"))) {
            json.insert("name".into(), json!(name));
        }
        let linked = image.uri.as_ref().filter(|_| writer.link_images);
        if let Some(uri) = linked {
            json.insert("uri".into(), json!(percent_encode(uri)));
            out.by_image.push(Some(out.textures.len()));
            out.textures.push(json!({"sampler": 0, "source": out.images.len()}));
            out.images.push(Value::Object(json));
            continue;
        }
        match (&image.data, image.data.as_deref().and_then(sniff)) {
            (Some(data), Some(mime @ ("image/png" | "image/jpeg"))) => {
                if writer.is_binary() {
                    json.insert("bufferView".into(), json!(writer.image_view(data)));
                    json.insert("mimeType".into(), json!(mime));
                } else {
                    let name = side_name(image.uri.as_deref(), mime, i, writer);
                    json.insert("uri".into(), json!(percent_encode(&name)));
                    writer.side_file(name, data.clone());
                }
            }
            (Some(_), _) => {
                writer.warn(format!(
                    "{label} is no PNG or JPEG, which are all that glTF holds: its texture was left out"
                ));
                out.by_image.push(None);
                continue;
            }
            (None, _) => {
                writer.warn(format!("{label} was not found: its texture was left out"));
                out.by_image.push(None);
                continue;
            }
        }
        out.by_image.push(Some(out.textures.len()));
        out.textures.push(json!({"sampler": 0, "source": out.images.len()}));
        out.images.push(Value::Object(json));
    }
    out
}

/// Images of a source's document that lie in files of their own: into the GLB, or beside the `.gltf`.
pub(super) fn place(document: &mut Map<String, Value>, scene: &Scene, writer: &mut Writer) {
    for (i, json) in array_of(document, "images").iter_mut().enumerate() {
        let Some(json) = json.as_object_mut() else { continue };
        let Some(uri) = json.get("uri").and_then(Value::as_str).map(String::from) else { continue };
        if is_remote(&uri) {
            continue; // a data URI, or a place on a network
        }
        let Some(data) = scene.images.get(i).and_then(|image| image.data.as_deref()) else {
            writer.warn(format!("image {uri} was not found: the output still refers to it"));
            continue;
        };
        let mime = sniff(data).or_else(|| json.get("mimeType").and_then(Value::as_str).and_then(known_mime));
        if writer.is_binary()
            && let Some(mime) = mime
        {
            json.shift_remove("uri");
            json.insert("mimeType".into(), json!(mime));
            json.insert("bufferView".into(), json!(writer.image_view(data)));
        } else {
            let name = side_name(Some(&uri), mime.unwrap_or_default(), i, writer);
            json.insert("uri".into(), json!(percent_encode(&name)));
            writer.side_file(name, data.to_vec());
        }
    }
}

fn known_mime(mime: &str) -> Option<&'static str> {
    ["image/png", "image/jpeg", "image/webp", "image/avif"].into_iter().find(|&m| m == mime)
}

/// A name for an image beside the output: its own if that stays below the output's folder, and is not taken.
fn side_name(uri: Option<&str>, mime: &str, number: usize, writer: &Writer) -> String {
    let own = uri.map(|u| String::from_utf8_lossy(&percent(u)).replace('\\', "/"));
    let is_safe = |n: &String| {
        !n.is_empty()
            && !n.contains(':')
            && !n.contains('\0')
            && n.split('/').all(|p| !matches!(p, "" | "." | ".."))
    };
    match own.filter(is_safe).filter(|n| !writer.has_side_file(n)) {
        Some(name) => name,
        None => {
            let extension = mime.strip_prefix("image/").unwrap_or("bin").replace("jpeg", "jpg");
            format!("image{number}.{extension}")
        }
    }
}
