//! Height grids: TIFF in all its shapes against the crate `tiff`, what is written is read again, and bad files are refused by name.

use progmesh::io::grid::write::{GridHead, write};
use progmesh::io::grid::{GridFile, GridFormat, GridOptions, SampleType, mosaic, open};
use progmesh::terrain::{Affine, Crs, CrsKind, Georeference, Grid, Raster, SampleAt, Window};
use std::io::{Cursor, Read, Write};
use std::sync::Arc;

mod made_tiff;
use made_tiff::{Made, Packing};

fn read_with(bytes: &[u8], name: &str, options: &GridOptions) -> Result<GridFile, String> {
    open(Arc::new(bytes.to_vec()), name, options).map_err(|e| e.to_string())
}

fn read(bytes: &[u8], name: &str) -> Result<GridFile, String> {
    read_with(bytes, name, &GridOptions::default())
}

fn whole(file: &GridFile) -> Result<Grid, String> {
    file.raster.whole(1 << 24).map_err(|e| e.to_string())
}

/// Equal, NaN to NaN.
fn same(a: &[f64], b: &[f64]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a == b || a.is_nan() && b.is_nan())
}

/// Heights that every sample type holds, neighbours far apart here and there.
fn heights(sample: SampleType, columns: usize, rows: usize) -> Vec<f64> {
    let value = |i: usize| {
        let hash = (i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40;
        let wide = (hash % 4001) as f64;
        match sample {
            SampleType::U8 => wide % 256.0,
            SampleType::I8 => wide % 256.0 - 128.0,
            SampleType::U16 => wide * 16.0,
            SampleType::I16 => wide * 16.0 - 32_000.0,
            SampleType::U32 => wide * 1_000_003.0,
            SampleType::I32 => wide * 1_000_003.0 - 2e9,
            SampleType::F32 => {
                let scale = if i.is_multiple_of(5) { 1e20 } else { -1.0 };
                f64::from((wide / 7.0) as f32 * scale)
            }
            SampleType::F64 => wide / 7.0 - 1e-9,
        }
    };
    (0..columns * rows).map(value).collect()
}

/// What the crate `tiff` makes of it; `None` for some LZW tiles, of which only a part lies in the picture: the streams are whole, and it reads them
/// itself as one row ([`lzw_streams_that_the_oracle_refuses_are_whole`]).
fn oracle(bytes: &[u8]) -> Option<Vec<f64>> {
    use tiff::decoder::{Decoder, DecodingResult as R};
    let mut decoder = Decoder::new(Cursor::new(bytes)).unwrap();
    let image = match decoder.read_image() {
        Err(e) if e.to_string().contains("no lzw end code") => return None,
        image => image.unwrap(),
    };
    Some(match image {
        R::U8(v) => v.into_iter().map(f64::from).collect(),
        R::I8(v) => v.into_iter().map(f64::from).collect(),
        R::U16(v) => v.into_iter().map(f64::from).collect(),
        R::I16(v) => v.into_iter().map(f64::from).collect(),
        R::U32(v) => v.into_iter().map(f64::from).collect(),
        R::I32(v) => v.into_iter().map(f64::from).collect(),
        R::F32(v) => v.into_iter().map(f64::from).collect(),
        R::F64(v) => v,
        _ => panic!("no sample type of a grid"),
    })
}

#[test]
fn every_type_packing_predictor_and_byte_order_is_read_as_the_oracle_does() {
    let (columns, rows) = (37, 29);
    let mut agreed = 0;
    for sample in SampleType::ALL {
        let want = heights(sample, columns, rows);
        for packing in [Packing::None, Packing::Lzw, Packing::Deflate] {
            for (i, (tile, big)) in
                [(None, false), (None, true), (Some(16), false), (Some(16), true)].into_iter().enumerate()
            {
                let predictors = match sample {
                    SampleType::F32 | SampleType::F64 => [1, 3],
                    _ => [1, 2],
                };
                for predictor in predictors {
                    let made = Made {
                        tile,
                        big_endian: big,
                        big_tiff: i % 2 == 1,
                        packing,
                        predictor,
                        rows_per_strip: 8,
                        ..Made::new(sample, columns, rows, &want)
                    };
                    let bytes = made.bytes();
                    let case =
                        format!("{sample:?} {packing:?} tile {tile:?} big {big} predictor {predictor}");
                    let file = read(&bytes, "a.tif").unwrap_or_else(|e| panic!("{case}: {e}"));
                    assert_eq!((file.format, file.sample), (GridFormat::Tiff, sample));
                    assert!(same(whole(&file).unwrap().heights(), &want), "{case}");
                    if let Some(theirs) = oracle(&bytes) {
                        assert!(same(&theirs, &want), "the oracle: {case}");
                        agreed += 1;
                    }
                }
            }
        }
    }
    assert!(agreed > 180, "{agreed} of 192");
}

/// Whether codes of an LZW stream make exactly so many bytes and are followed by the end code, by the rules of TIFF 6.0, section 13.
fn is_whole(packed: &[u8], size: usize) -> bool {
    let code = |at: usize, width: usize| {
        (at..at + width).try_fold(0usize, |c, bit| {
            let byte = packed.get(bit / 8)?;
            Some(2 * c + usize::from(byte >> (7 - bit % 8) & 1))
        })
    };
    let (mut at, mut width, mut before, mut written) = (0, 9, None, 0);
    let mut lengths: Vec<usize> = vec![];
    loop {
        let Some(c) = code(at, width) else { return false };
        at += width;
        match c {
            256 => (width, before, lengths) = (9, None, vec![1; 258]),
            257 => return written == size && packed.len() == at.div_ceil(8),
            c => {
                if let Some(before) = before {
                    // The entry is the one before and a byte.
                    lengths.push(lengths[before] + 1);
                    if lengths.len() + 1 >= 1 << width && width < 12 {
                        width += 1;
                    }
                }
                let Some(length) = lengths.get(c) else { return false };
                written += length;
                before = Some(c);
            }
        }
    }
}

#[test]
fn lzw_streams_that_the_oracle_refuses_are_whole() {
    let mut random = 1u32;
    let mut refused = 0;
    for levels in [2, 16, 256].repeat(60) {
        let mut byte = || {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (random >> 16) % levels
        };
        // Two tiles; of the second only five columns are used.
        let (columns, rows) = (21, 16);
        let want: Vec<f64> = (0..columns * rows).map(|_| f64::from(byte())).collect();
        fn made(tile: Option<usize>, [columns, rows]: [usize; 2], heights: &[f64]) -> Vec<u8> {
            let made = Made::new(SampleType::U8, columns, rows, heights);
            Made { tile, packing: Packing::Lzw, ..made }.bytes()
        }
        let file = made(Some(16), [columns, rows], &want);
        assert!(same(whole(&read(&file, "a.tif").unwrap()).unwrap().heights(), &want));
        if oracle(&file).is_none() {
            refused += 1;
            for first in [0, 16] {
                let sample = |i: usize| match first + i % 16 {
                    x if x < columns => want[i / 16 * columns + x],
                    _ => 0.0,
                };
                let tile: Vec<f64> = (0..256).map(sample).collect();
                let bytes: Vec<u8> = tile.iter().map(|&h| h as u8).collect();
                assert!(is_whole(&Packing::Lzw.pack(&bytes), 256));
                // The very stream, as one row.
                assert!(oracle(&made(None, [256, 1], &tile)).is_some_and(|theirs| same(&theirs, &tile)));
            }
        }
    }
    assert!(refused > 0, "the oracle reads all of them: give it all streams again");
}

#[test]
fn windows_are_parts_of_the_whole_whatever_the_cache() {
    let (columns, rows) = (61, 47);
    let want = heights(SampleType::I16, columns, rows);
    let grid = Grid::new(columns, rows, want.clone()).unwrap();
    let made = |tile, rows_per_strip, packing| Made {
        tile,
        rows_per_strip,
        packing,
        ..Made::new(SampleType::I16, columns, rows, &want)
    };
    for made in [
        made(Some(16), 0, Packing::Deflate),
        made(Some(32), 0, Packing::None),
        made(None, 5, Packing::Lzw),
        made(None, u32::MAX, Packing::None),
        made(None, 1, Packing::None),
    ] {
        let bytes = made.bytes();
        for cache in [0, 3000, 1 << 20] {
            let options = GridOptions::default().with_cache(cache);
            let file = read_with(&bytes, "a.tif", &options).unwrap();
            for (x, y, w, h) in
                [(0, 0, 61, 47), (15, 15, 2, 2), (60, 46, 1, 1), (7, 30, 40, 17), (0, 46, 61, 1)]
            {
                let window = Window::new(x, y, w, h);
                let (a, b) = (file.raster.window(window).unwrap(), grid.window(window).unwrap());
                assert!(same(a.heights(), b.heights()), "{window:?} cache {cache}");
            }
            assert!(file.raster.window(Window::new(60, 0, 2, 1)).is_err());
        }
    }
}

#[test]
fn the_first_band_of_several_is_read() {
    let want = heights(SampleType::U16, 20, 9);
    for (planar, predictor) in [(false, 1), (false, 2), (true, 2)] {
        let made = Made {
            bands: 3,
            planar,
            predictor,
            packing: Packing::Deflate,
            rows_per_strip: 4,
            ..Made::new(SampleType::U16, 20, 9, &want)
        };
        let file = read(&made.bytes(), "a.tif").unwrap();
        assert!(same(whole(&file).unwrap().heights(), &want), "planar {planar} predictor {predictor}");
        assert!(file.warnings.iter().any(|w| w.contains("3 bands")), "{:?}", file.warnings);
    }
}

#[test]
fn nodata_is_void_and_infinity_an_error_that_says_where() {
    let mut want = heights(SampleType::F32, 8, 6);
    let lowest = f64::from(f32::MIN);
    (want[9], want[10], want[11]) = (lowest, f64::NAN, 1e30f32.into());
    let mut made = Made::new(SampleType::F32, 8, 6, &want);
    // GDAL writes the digits of the f64, and -3.4e38 of many.
    made.nodata = Some("-3.4028234663852886e+38 ".into());
    let file = read(&made.bytes(), "a.tif").unwrap();
    let grid = whole(&file).unwrap();
    assert_eq!((file.nodata, grid.height(1, 1), grid.height(2, 1)), (Some(lowest), None, None));
    assert_eq!(grid.height(3, 1), Some(1e30f32.into()));

    want[20] = f64::INFINITY;
    let made = Made::new(SampleType::F32, 8, 6, &want);
    let e = whole(&read(&made.bytes(), "b.tif").unwrap()).unwrap_err();
    assert_eq!(e, "b.tif: column 4, row 2: the height is infinite; if that means no data, say so");
    let mut options = GridOptions::default();
    options.nodata = Some(f64::INFINITY);
    let grid = whole(&read_with(&made.bytes(), "b.tif", &options).unwrap()).unwrap();
    assert_eq!((grid.height(4, 2), grid.height(1, 1)), (None, Some(lowest)));

    let mut odd = Made::new(SampleType::F32, 8, 6, &want);
    odd.nodata = Some("none".into());
    assert!(read(&odd.bytes(), "c.tif").unwrap().warnings[0].contains("\"none\", is no number"));
}

#[test]
fn a_sample_lies_where_the_tags_say() {
    let place = |keys: &[u16], doubles: &[(u16, &[f64])]| {
        let mut made = Made::new(SampleType::U8, 4, 3, &[0.0; 12]);
        made.keys = keys.to_vec();
        made.doubles = doubles.iter().map(|(t, v)| (*t, v.to_vec())).collect();
        read(&made.bytes(), "a.tif").unwrap().georeference
    };
    let (scale, tie) =
        ((33550, [10.0, 20.0, 0.0].as_slice()), (33922, [0.0, 0.0, 0.0, 100.0, 200.0, 0.0].as_slice()));
    let area = [1, 1, 0, 3, 1024, 0, 1, 1, 1025, 0, 1, 1, 3072, 0, 1, 32633];
    let g = place(&area, &[scale, tie]);
    assert_eq!(g.transform.unwrap().apply([0.0, 0.0]), [105.0, 190.0]);
    assert_eq!(g.sample_at, SampleAt::CellCentre);
    let crs = g.crs.unwrap();
    assert_eq!((crs.kind, crs.epsg), (CrsKind::Projected { metres: 1.0 }, Some(32633)));
    let mut point = area;
    point[11] = 2;
    let g = place(&point, &[scale, tie]);
    assert_eq!((g.transform.unwrap().apply([1.0, 1.0]), g.sample_at), ([110.0, 180.0], SampleAt::Point));
    // A tiepoint elsewhere, and a full matrix.
    let g = place(&point, &[scale, (33922, &[2.0, 1.0, 0.0, 100.0, 200.0, 0.0])]);
    assert_eq!(g.transform.unwrap().apply([2.0, 1.0]), [100.0, 200.0]);
    let matrix = [0.0, 2.0, 0.0, 5.0, 3.0, 0.0, 0.0, 7.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let g = place(&point, &[(34264, &matrix)]);
    assert_eq!(g.transform.unwrap().apply([1.0, 10.0]), [25.0, 10.0]);
    // Feet, by code and by number; degrees.
    let mut feet = point.to_vec();
    (feet[3], feet[12]) = (3, 3076);
    feet[15] = 9002;
    assert_eq!(place(&feet, &[scale, tie]).crs.unwrap().kind, CrsKind::Projected { metres: 0.3048 });
    let degrees = [1, 1, 0, 2, 1024, 0, 1, 2, 2048, 0, 1, 4326];
    let g = place(&degrees, &[scale, tie]);
    assert_eq!((g.crs.as_ref().unwrap().kind, g.crs.unwrap().epsg), (CrsKind::Geographic, Some(4326)));
    // What has no inverse is left out; nothing is made up where nothing is said.
    assert_eq!(place(&degrees, &[(33550, &[0.0, 0.0, 0.0]), tie]).transform, None);
    assert_eq!(place(&[], &[]), Georeference::default());
    assert_eq!(place(&[1, 1, 0, 9], &[tie]).transform, None);
}

fn landscape() -> (Grid, Georeference) {
    let heights: Vec<f64> = (0..300 * 70).map(|i| f64::from(i % 997) + 0.5).collect();
    let crs =
        Crs { kind: CrsKind::Projected { metres: 0.25 }, name: Some("local".into()), ..Default::default() };
    let georeference = Georeference {
        transform: Some(Affine::north_up([10.0, 900.0], [4.0, 4.0])),
        sample_at: SampleAt::CellCentre,
        crs: Some(crs),
    };
    (Grid::new(300, 70, heights).unwrap(), georeference)
}

fn written(format: GridFormat, grid: &Grid, georeference: &Georeference) -> Result<Vec<u8>, String> {
    let head = GridHead { columns: grid.columns(), rows: grid.rows(), georeference };
    let mut out = vec![];
    let mut row = |r: usize, line: &mut [f64]| {
        line.copy_from_slice(&grid.heights()[r * grid.columns()..(r + 1) * grid.columns()]);
        Ok(())
    };
    write(format, &head, &mut row, &mut out).map_err(|e| e.to_string())?;
    Ok(out)
}

#[test]
fn what_is_written_is_read_again() {
    let (grid, georeference) = landscape();
    let bytes = written(GridFormat::Tiff, &grid, &georeference).unwrap();
    let file = read(&bytes, "a.tif").unwrap();
    assert!(same(whole(&file).unwrap().heights(), grid.heights()) && file.warnings.is_empty());
    assert!(same(&oracle(&bytes).unwrap(), grid.heights()), "the oracle reads it too");
    assert_eq!(file.georeference.transform, georeference.transform);
    assert_eq!(file.georeference.crs.as_ref().unwrap().kind, CrsKind::Projected { metres: 0.25 });
    assert_eq!(file.georeference.crs.as_ref().unwrap().name.as_deref(), Some("local"));
    // Keys are passed on as they are.
    let again = read(&written(GridFormat::Tiff, &grid, &file.georeference).unwrap(), "a.tif").unwrap();
    assert_eq!(again.georeference, file.georeference);

    let file = read(&written(GridFormat::Ascii, &grid, &georeference).unwrap(), "a").unwrap();
    assert!(same(whole(&file).unwrap().heights(), grid.heights()) && file.format == GridFormat::Ascii);
    assert_eq!(file.georeference.transform, georeference.transform);

    let mut options = GridOptions::default();
    (options.size, options.sample) = (Some([300, 70]), Some((SampleType::F32, Default::default())));
    let bytes = written(GridFormat::Raw, &grid, &georeference).unwrap();
    assert!(same(whole(&read_with(&bytes, "a.raw", &options).unwrap()).unwrap().heights(), grid.heights()));

    let file = read(&written(GridFormat::Png, &grid, &georeference).unwrap(), "a.png").unwrap();
    let rounded: Vec<f64> = grid.heights().iter().map(|h| h.round()).collect();
    assert!(same(whole(&file).unwrap().heights(), &rounded));
    let e = written(GridFormat::Hgt, &grid, &georeference).unwrap_err();
    assert_eq!(e, "HGT holds squares only");
    let mut square: Vec<f64> = grid.heights()[..49].to_vec();
    (square[3], square[4], square[5]) = (f64::NAN, 1e9, -1e9);
    let square = Grid::new(7, 7, square).unwrap();
    let file = read(&written(GridFormat::Hgt, &square, &georeference).unwrap(), "x/S02W003.hgt").unwrap();
    let found = whole(&file).unwrap();
    assert_eq!([3, 4, 5].map(|c| found.height(c, 0)), [None, Some(32767.0), Some(-32767.0)]);
    assert_eq!(file.georeference.transform.unwrap().apply([0.0, 6.0]), [-3.0, -2.0]);

    let mut turned = georeference.clone();
    turned.transform = Some(Affine([0.0, 2.0, 5.0, 3.0, 0.0, 7.0]));
    let file = read(&written(GridFormat::Tiff, &grid, &turned).unwrap(), "a.tif").unwrap();
    assert_eq!(file.georeference.transform, turned.transform);
    assert!(written(GridFormat::Ascii, &grid, &turned).unwrap_err().contains("equal spacings"));
}

fn png(color: png::ColorType, depth: png::BitDepth, size: [u32; 2], data: &[u8]) -> Vec<u8> {
    let mut bytes = vec![];
    let mut encoder = png::Encoder::new(&mut bytes, size[0], size[1]);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.write_header().unwrap().write_image_data(data).unwrap();
    bytes
}

#[test]
fn pictures_code_heights() {
    use png::{BitDepth, ColorType};
    let rgb = |data: &[u8]| png(ColorType::Rgb, BitDepth::Eight, [2, 1], data);
    let file = read(&rgb(&[1, 134, 160, 1, 134, 161]), "a.png").unwrap();
    assert_eq!(whole(&file).unwrap().heights(), [0.0, 0.1]);
    let e = read(&rgb(&[200, 10, 10, 9, 9, 9]), "a.png").unwrap_err();
    assert!(e.contains("an ordinary picture?"), "{e}");
    let mut options = GridOptions::default();
    options.encoding = Some(progmesh::io::grid::Encoding::Terrarium);
    let file = read_with(&rgb(&[128, 1, 128, 127, 255, 0]), "a.png", &options).unwrap();
    assert_eq!(whole(&file).unwrap().heights(), [1.5, -1.0]);
    let file =
        read(&png(ColorType::Rgba, BitDepth::Eight, [2, 1], &[1, 134, 160, 0, 1, 134, 160, 9]), "a.png");
    assert_eq!(whole(&file.unwrap()).unwrap().height(0, 0), None);
    let file =
        read(&png(ColorType::Grayscale, BitDepth::Sixteen, [2, 1], &[255, 255, 0, 7]), "a.png").unwrap();
    assert_eq!(whole(&file).unwrap().heights(), [65535.0, 7.0]);
    let file =
        read(&png(ColorType::GrayscaleAlpha, BitDepth::Eight, [2, 1], &[5, 0, 6, 1]), "a.png").unwrap();
    let grid = whole(&file).unwrap();
    assert_eq!([grid.height(0, 0), grid.height(1, 0)], [None, Some(6.0)]);
    assert!(read(&png(ColorType::Grayscale, BitDepth::One, [8, 1], &[0]), "a.png").is_err());
    let e = read_with(&png(ColorType::Grayscale, BitDepth::Eight, [1, 1], &[0]), "a.png", &options);
    assert!(e.unwrap_err().contains("needs colours"));
}

#[test]
fn rows_of_a_picture_come_in_any_order() {
    let want: Vec<f64> = (0..3000 * 900).map(|i| f64::from(i as u32 % 64_007)).collect();
    let grid = Grid::new(3000, 900, want).unwrap();
    let bytes = written(GridFormat::Png, &grid, &Georeference::default()).unwrap();
    let options = GridOptions::default().with_cache(0);
    let file = read_with(&bytes, "a.png", &options).unwrap();
    for row in [899, 0, 500, 340, 360, 899] {
        let window = Window::new(2990, row, 10, 1);
        assert_eq!(file.raster.window(window).unwrap().heights(), grid.window(window).unwrap().heights());
    }
}

#[test]
fn tiles_beside_each_other_are_one_grid() {
    let tile = |name: &str, base: f64| {
        let heights = (0..9).map(|i| base + f64::from(i)).collect();
        let grid = Grid::new(3, 3, heights).unwrap();
        let bytes = written(GridFormat::Hgt, &grid, &Georeference::default()).unwrap();
        (name.to_string(), read(&bytes, name).unwrap())
    };
    // Neighbours share a line of samples.
    let file = mosaic(vec![tile("N57E011.hgt", 0.0), tile("N57E012.hgt", 100.0)]).unwrap();
    let grid = whole(&file).unwrap();
    assert_eq!((grid.columns(), grid.rows()), (5, 3));
    assert_eq!(grid.heights()[..5], [0.0, 1.0, 2.0, 101.0, 102.0]);
    let file = mosaic(vec![tile("N57E011.hgt", 0.0), tile("N56E012.hgt", 100.0)]).unwrap();
    let grid = whole(&file).unwrap();
    assert_eq!((grid.columns(), grid.rows(), grid.height(4, 0)), (5, 5, None));
    assert_eq!(file.georeference.transform.unwrap().apply([0.0, 0.0]), [11.0, 58.0]);
    let wide = Grid::new(5, 5, vec![0.0; 25]).unwrap();
    let wide =
        read(&written(GridFormat::Hgt, &wide, &Georeference::default()).unwrap(), "N57E012.hgt").unwrap();
    let e = mosaic(vec![tile("N57E011.hgt", 0.0), ("N57E012.hgt".into(), wide)]).unwrap_err();
    assert!(e.to_string().starts_with("N57E012.hgt has a spacing of 0.25 x 0.25"), "{e}");
}

#[test]
fn a_truncated_tiff_names_its_file_and_tile() {
    let want = heights(SampleType::I16, 40, 40);
    let made = |packing| Made { tile: Some(16), packing, ..Made::new(SampleType::I16, 40, 40, &want) };
    for packing in [Packing::None, Packing::Lzw, Packing::Deflate] {
        let bytes = made(packing).bytes();
        // Its directory lies in front.
        let cut = &bytes[..bytes.len() - 10];
        let e = whole(&read(cut, "cut.tif").unwrap()).unwrap_err();
        assert_eq!(e, "cut.tif: tile 8 (from column 32, row 32): the file ends before");
        assert!(read(&bytes[..100], "cut.tif").unwrap_err().contains("the file ends before"));
    }
    // A byte wrong within the packed data.
    let mut bytes = made(Packing::Deflate).bytes();
    let at = bytes.len() - 20;
    bytes[at] ^= 0xff;
    let e = whole(&read(&bytes, "bad.tif").unwrap()).unwrap_err();
    assert!(e.starts_with("bad.tif: tile 8 (from column 32, row 32): "), "{e}");
}

#[test]
fn large_sizes_announced_in_small_files_are_refused_or_void() {
    let tiny = |f: fn(&mut Made<'_>)| {
        let mut made = Made::new(SampleType::F32, 8, 8, &[1.0; 64]);
        f(&mut made);
        read(&made.bytes(), "a.tif")
    };
    let said = |r: Result<GridFile, String>| r.map(|_| ()).unwrap_err();
    let e = said(tiny(|m| (m.announced, m.rows_per_strip) = ([65_536; 2], 1)));
    assert_eq!(e, "strips: 65536 x 65536 samples need 65536; the file lists 8");
    let e = said(tiny(|m| {
        (m.announced, m.rows_per_strip, m.packing) = ([65_536; 2], u32::MAX, Packing::Deflate)
    }));
    assert!(e.contains("write it anew in small tiles"), "{e}");
    let e =
        said(tiny(|m| (m.announced, m.rows_per_strip, m.packing) = ([60_000, 1000], u32::MAX, Packing::Lzw)));
    assert!(e.contains("240000000 bytes announced, in at most"), "{e}");
    // Not packed, in one strip: it opens, and the rows that are there can be read.
    let file = tiny(|m| (m.announced, m.rows_per_strip) = ([65_536; 2], u32::MAX)).unwrap();
    let e = file.raster.window(Window::new(0, 60_000, 1, 1)).unwrap_err().to_string();
    assert!(e.starts_with("a.tif: strip 0 (from column 0, row 60000)"), "{e}");
    assert!(
        file.raster.whole(1 << 26).unwrap_err().to_string().contains("4294967296")
            || file.raster.columns() == 65_536
    );
    for size in [[0, 8], [8, 0]] {
        let mut made = Made::new(SampleType::U8, 8, 8, &[1.0; 64]);
        made.announced = size;
        assert!(said(read(&made.bytes(), "a.tif")).contains("it must be from 1"));
    }
    // Tiles that are not there are void: GDAL's sparse files.
    let mut sparse = Made::new(SampleType::F32, 40, 40, &[1.0; 1600]);
    (sparse.tile, sparse.missing) = (Some(16), vec![4]);
    let grid = whole(&read(&sparse.bytes(), "a.tif").unwrap()).unwrap();
    assert_eq!(grid.heights().iter().filter(|h| h.is_nan()).count(), 256);
    assert_eq!((grid.height(16, 16), grid.height(15, 16)), (None, Some(1.0)));
    // A PNG and an HGT that announce more than they hold.
    let mut bytes = png(png::ColorType::Grayscale, png::BitDepth::Sixteen, [1, 1], &[0, 1]);
    bytes[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]);
    let crc = crc(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&crc.to_be_bytes());
    let file = read(&bytes, "a.png").unwrap();
    let e = file.raster.window(Window::new(0, 0, 65_536, 1)).unwrap_err().to_string();
    assert!(e.starts_with("a.png: row 0: "), "{e}");
}

/// The checksum of PNG chunks.
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |c, &b| {
        (0..8).fold(c ^ u32::from(b), |c, _| if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 })
    })
}

#[test]
fn what_is_not_read_is_named() {
    let said = |f: fn(&mut Made<'_>)| {
        let mut made = Made::new(SampleType::U16, 8, 8, &[1.0; 64]);
        f(&mut made);
        read(&made.bytes(), "a.tif").map(|_| ()).unwrap_err()
    };
    assert_eq!(
        said(|m| m.compression = Some(50_000)),
        "needs Zstandard compression (write it anew with Deflate), which is not supported"
    );
    assert_eq!(said(|m| m.compression = Some(4242)), "needs TIFF compression 4242, which is not supported");
    assert!(said(|m| m.predictor = 3).contains("3 is for floating-point samples"));
    assert!(said(|m| m.bits = Some(12)).contains("unsigned whole numbers of 12 bits"));
    let e = read(b"no grid", "a.xyz").unwrap_err();
    assert_eq!(
        e,
        "neither its name nor its first bytes tell the format; say it (tiff, hgt, ascii, png, raw)"
    );
    let e = read(&[0; 100], "a.hgt").unwrap_err();
    assert!(e.contains("a square of 16-bit samples") && e.contains("100 bytes"), "{e}");
    let mut options = GridOptions::default();
    assert!(read_with(&[0; 100], "a.raw", &options).unwrap_err().contains("need a size and a type"));
    (options.size, options.sample) = (Some([10, 6]), Some((SampleType::I16, Default::default())));
    let e = read_with(&[0; 100], "a.raw", &options).unwrap_err();
    assert_eq!(e, "size: 10 x 6 samples of type i16 are 120 bytes, and the file has 100");
}

#[test]
fn every_truncation_and_flipped_byte_is_survived() {
    let want = heights(SampleType::F32, 9, 7);
    let made = |tile, packing, predictor, big| Made {
        tile,
        packing,
        predictor,
        big_tiff: big,
        big_endian: big,
        rows_per_strip: 3,
        ..Made::new(SampleType::F32, 9, 7, &want)
    };
    for made in [
        made(Some(16), Packing::Deflate, 3, true),
        made(None, Packing::Lzw, 1, false),
        made(None, Packing::None, 2, true),
    ] {
        let bytes = made.bytes();
        let survive = |bytes: &[u8]| {
            if let Ok(file) = read(bytes, "a.tif") {
                let _ = file.raster.window(Window::new(0, 0, 1, 1));
                let _ = file.raster.whole(1 << 10);
            }
        };
        (0..bytes.len()).for_each(|n| survive(&bytes[..n]));
        for at in 0..bytes.len() {
            for flip in [0xff, 0x01, 0x80] {
                let mut bad = bytes.clone();
                bad[at] ^= flip;
                survive(&bad);
            }
        }
    }
}

#[test]
fn several_threads_read_at_once() {
    let want = heights(SampleType::I16, 200, 200);
    let made =
        Made { tile: Some(32), packing: Packing::Deflate, ..Made::new(SampleType::I16, 200, 200, &want) };
    let options = GridOptions::default().with_cache(50_000);
    let file = read_with(&made.bytes(), "a.tif", &options).unwrap();
    std::thread::scope(|s| {
        for start in 0..4usize {
            let (raster, want): (&dyn Raster, _) = (&*file.raster, &want);
            s.spawn(move || {
                for row in (start..200).step_by(3) {
                    let grid = raster.window(Window::new(0, row, 200, 1)).unwrap();
                    assert!(same(grid.heights(), &want[row * 200..(row + 1) * 200]));
                }
            });
        }
    });
}

#[test]
fn unpacked_bytes_are_those_that_were_packed() {
    // The test's own packers, so that a fault of theirs is not one of the reader's.
    let bytes: Vec<u8> = (0..5000u32).map(|i| ((i * i) >> 3) as u8).collect();
    let mut out = vec![];
    flate2::read::ZlibDecoder::new(&Packing::Deflate.pack(&bytes)[..]).read_to_end(&mut out).unwrap();
    assert_eq!(out, bytes);
    let mut sink = vec![];
    sink.write_all(&Packing::None.pack(&bytes)).unwrap();
    assert_eq!(sink, bytes);
}
