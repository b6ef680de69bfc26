//! The C++ codec encodes and is the oracle; our decoder must give its bytes.

use super::*;
use ::meshopt::encoding as oracle;
use proptest::prelude::*;

fn run(stream: &[u8], mode: &str, filter: &str, count: usize, stride: usize) -> Result<Vec<u8>, DecodeError> {
    decode(stream, Layout { mode, filter, count, stride }, "bufferViews[0]")
}

/// A walk with steps of many sizes, so that every bit length and control mode is met.
fn walk(seed: u32, count: usize, step: u32) -> Vec<u32> {
    let mut state = seed | 1;
    let mut value = seed;
    (0..count)
        .map(|i| {
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            if i / 64 % 3 != 2 {
                value = value.wrapping_add(state % step.max(1));
            }
            value
        })
        .collect()
}

fn check_attributes<const N: usize>(words: &[u32]) {
    let elements: Vec<[u32; N]> = words.as_chunks::<N>().0.to_vec();
    let plain: Vec<u8> = elements.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
    for (level, version) in [(0, 0), (0, 1), (1, 1), (2, 1), (3, 1)] {
        let stream = oracle::encode_vertex_buffer_level(&elements, level, Some(version)).unwrap();
        let ours = run(&stream, "ATTRIBUTES", "NONE", elements.len(), 4 * N);
        // Not assert_eq: a failure would print megabytes.
        assert!(ours.as_deref() == Ok(&plain[..]), "stride {} level {level} version {version}", 4 * N);
    }
}

/// A grid of triangles, with a few jumps.
fn grid(n: u32, shuffle: u32) -> Vec<u32> {
    let mut out = Vec::new();
    for y in 0..n {
        for x in 0..n {
            let v = y * (n + 1) + x;
            let v = if shuffle > 0 && (x + y) % 7 == 3 { (v * shuffle) % (n * n) } else { v };
            out.extend([v, v + 1, v + n + 1, v + 1, v + n + 2, v + n + 1]);
        }
    }
    out
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn attributes_are_as_the_oracle_encoded_them(seed: u32, count in 1usize..700, bits in 0u32..32) {
        let words = walk(seed, count * 4, 1 << bits);
        check_attributes::<1>(&words);
        check_attributes::<2>(&words);
        check_attributes::<3>(&words);
        check_attributes::<4>(&words);
        check_attributes::<64>(&words);
    }

    #[test]
    fn indices_are_as_the_oracle_decodes_them(n in 1u32..24, shuffle in 0u32..50) {
        let indices = grid(n, shuffle);
        let vertices = indices.iter().max().map_or(0, |m| *m as usize + 1);
        let stream = oracle::encode_index_buffer(&indices, vertices).unwrap();
        // The codec may rotate triangles: compare with the oracle's own decoding.
        let theirs: Vec<u32> = oracle::decode_index_buffer(&stream, indices.len()).unwrap();
        let plain: Vec<u8> = theirs.iter().flat_map(|i| i.to_le_bytes()).collect();
        prop_assert_eq!(run(&stream, "TRIANGLES", "NONE", indices.len(), 4), Ok(plain));
        let short: Vec<u8> = theirs.iter().flat_map(|&i| (i as u16).to_le_bytes()).collect();
        prop_assert_eq!(run(&stream, "TRIANGLES", "NONE", indices.len(), 2), Ok(short));

        let stream = oracle::encode_index_sequence(&indices, vertices).unwrap();
        let plain: Vec<u8> = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
        prop_assert_eq!(run(&stream, "INDICES", "NONE", indices.len(), 4), Ok(plain));
    }

    #[test]
    fn no_bytes_make_it_panic_or_give_another_length(
        stream in prop::collection::vec(any::<u8>(), 0..400),
        count in 0usize..3000,
        which in 0usize..7,
    ) {
        let (mode, filter, stride, first) = [
            ("ATTRIBUTES", "NONE", 4, 0xa0),
            ("ATTRIBUTES", "OCTAHEDRAL", 8, 0xa1),
            ("ATTRIBUTES", "QUATERNION", 8, 0xa1),
            ("ATTRIBUTES", "EXPONENTIAL", 12, 0xa0),
            ("ATTRIBUTES", "COLOR", 4, 0xa1),
            ("TRIANGLES", "NONE", 4, 0xe1),
            ("INDICES", "NONE", 2, 0xd1),
        ][which];
        let mut stream = stream;
        if let Some(b) = stream.first_mut() {
            *b = first;
        }
        if let Ok(bytes) = run(&stream, mode, filter, count, stride) {
            prop_assert_eq!(bytes.len(), count * stride);
        }
    }
}

/// Unit vectors and colours in all directions.
fn vectors() -> Vec<[f32; 4]> {
    (0..500)
        .map(|i| {
            let t = i as f32 * 0.37;
            let v = glam::Vec4::new(t.sin(), (1.3 * t).cos(), (0.7 * t).sin(), (2.1 * t).cos());
            v.normalize().to_array()
        })
        .collect()
}

/// Compares numbers of `N` bytes that may differ by one in the last place.
fn assert_near(ours: &[u8], theirs: &[i32], size: usize) {
    let read = |b: &[u8]| if size == 1 { b[0] as i8 as i32 } else { i16::from_le_bytes([b[0], b[1]]) as i32 };
    assert_eq!(ours.len(), theirs.len() * size);
    for (i, (a, &b)) in ours.chunks(size).map(read).zip(theirs).enumerate() {
        assert!((a - b).abs() <= 1, "number {i}: {a}, oracle {b}");
    }
}

#[test]
fn the_octahedral_filter_is_the_oracles_to_one_unit() {
    let normals: Vec<[f32; 4]> =
        vectors().iter().map(|v| glam::Vec3::from_slice(v).normalize().extend(1.0).to_array()).collect();
    for bits in [4, 8] {
        let mut coded: Vec<[i8; 4]> = oracle::encode_filter_oct(&normals, bits);
        let stream = oracle::encode_vertex_buffer(&coded).unwrap();
        oracle::decode_filter_oct(&mut coded);
        let theirs: Vec<i32> = coded.as_flattened().iter().map(|&x| x as i32).collect();
        assert_near(&run(&stream, "ATTRIBUTES", "OCTAHEDRAL", 500, 4).unwrap(), &theirs, 1);
    }
    for bits in [10, 16] {
        let mut coded: Vec<[i16; 4]> = oracle::encode_filter_oct(&normals, bits);
        let stream = oracle::encode_vertex_buffer(&coded).unwrap();
        oracle::decode_filter_oct(&mut coded);
        let theirs: Vec<i32> = coded.as_flattened().iter().map(|&x| x as i32).collect();
        assert_near(&run(&stream, "ATTRIBUTES", "OCTAHEDRAL", 500, 8).unwrap(), &theirs, 2);
    }
}

#[test]
fn the_quaternion_filter_is_the_oracles_to_one_unit() {
    let mut coded = oracle::encode_filter_quat(&vectors(), 12);
    let stream = oracle::encode_vertex_buffer(&coded).unwrap();
    oracle::decode_filter_quat(&mut coded);
    let theirs: Vec<i32> = coded.as_flattened().iter().map(|&x| x as i32).collect();
    assert_near(&run(&stream, "ATTRIBUTES", "QUATERNION", 500, 8).unwrap(), &theirs, 2);
}

#[test]
fn the_exponential_filter_is_the_oracles_exactly() {
    let data: Vec<[f32; 4]> =
        vectors().iter().enumerate().map(|(i, v)| v.map(|x| x * 1.5f32.powi(i as i32 % 90 - 45))).collect();
    let mut coded = oracle::encode_filter_exp(&data, 15, oracle::EncodeExpMode::Separate);
    let stream = oracle::encode_vertex_buffer(&coded).unwrap();
    oracle::decode_filter_exp(&mut coded);
    let theirs: Vec<u8> = coded.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
    assert_eq!(run(&stream, "ATTRIBUTES", "EXPONENTIAL", 500, 16), Ok(theirs));
}

#[test]
fn the_color_filter_is_the_oracles_to_one_unit() {
    let data: Vec<[f32; 4]> = vectors().iter().map(|v| v.map(f32::abs)).collect();
    let mut coded: Vec<[u8; 4]> = oracle::encode_filter_color(&data, 8);
    let stream = oracle::encode_vertex_buffer(&coded).unwrap();
    oracle::decode_filter_color(&mut coded);
    let ours = run(&stream, "ATTRIBUTES", "COLOR", 500, 4).unwrap();
    assert!(ours.iter().zip(coded.as_flattened()).all(|(a, b)| a.abs_diff(*b) <= 1));
}

#[test]
fn every_cut_of_a_stream_is_an_error() {
    let elements: Vec<[u32; 2]> = walk(7, 400, 900).as_chunks::<2>().0.to_vec();
    let streams = [
        ("ATTRIBUTES", oracle::encode_vertex_buffer(&elements).unwrap(), elements.len(), 8),
        ("TRIANGLES", oracle::encode_index_buffer(&grid(8, 3), 100).unwrap(), grid(8, 3).len(), 4),
        ("INDICES", oracle::encode_index_sequence(&grid(8, 3), 100).unwrap(), grid(8, 3).len(), 4),
    ];
    for (mode, stream, count, stride) in streams {
        assert!(run(&stream, mode, "NONE", count, stride).is_ok());
        for n in 0..stream.len() {
            assert!(run(&stream[..n], mode, "NONE", count, stride).is_err(), "{mode} cut to {n}");
        }
    }
}

#[test]
fn layouts_that_the_extension_forbids_are_refused() {
    let e = run(&[0xa0], "ATTRIBUTES", "NONE", 1, 6).unwrap_err().to_string();
    assert!(e.starts_with("bufferViews[0]: byteStride 6"), "{e}");
    assert!(run(&[0xa0], "ATTRIBUTES", "QUATERNION", 1, 4).is_err());
    assert!(run(&[0xe1], "TRIANGLES", "NONE", 4, 2).is_err());
    let e = run(&[0xa0], "ATTRIBUTES", "WAVELET", 1, 4).unwrap_err();
    assert_eq!(e, DecodeError::Unsupported { what: "meshopt filter WAVELET".into() });
}
