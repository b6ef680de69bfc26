"use strict";
// Reads a recording (src/selective/record.rs says what is in it). Knows nothing of drawing.

const inflate = async (bytes) => {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
};

const bytesOf = (base64) => {
  const text = atob(base64.trim());
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return bytes;
};

const blocksOf = (bytes) => {
  const view = new DataView(bytes.buffer, bytes.byteOffset);
  const count = view.getUint32(0, true);
  const blocks = [];
  let at = 4 + 4 * count;
  for (let k = 0; k < count; k++) {
    const length = view.getUint32(4 + 4 * k, true);
    blocks.push(bytes.subarray(at, at + length));
    at += length;
  }
  return blocks;
};

// Twelve planes of bytes to three floats a place.
const placesOf = (bytes, count) => {
  const places = new Float32Array(3 * count);
  const out = new DataView(places.buffer);
  for (let k = 0; k < 12; k++) {
    const axis = k >> 2;
    for (let i = 0; i < count; i++) out.setUint8(4 * (3 * i + axis) + (k & 3), bytes[k * count + i]);
  }
  return places;
};

// The index buffers and vertices of one tolerance, frame by frame.
class Track {
  constructor(bytes, meshes, frames) {
    this.bytes = bytes;
    this.frames = frames;
    this.frame = -1;
    this.position = 0;
    this.meshes = meshes.map((m) => ({
      slots: 0,
      corners: new Uint32Array(3 * 1024),
      at: new Uint32Array(m.vertices),
      // What is not on the GPU: slots from and to, and vertices; null: everything.
      ranges: null,
      vertices: null,
    }));
    this.keys = [];
    this.spacing = 32;
  }

  number() {
    let value = 0;
    let scale = 1;
    for (;;) {
      const byte = this.bytes[this.position++];
      if (byte === undefined) throw new Error("the recording ends early");
      value += (byte & 127) * scale;
      if (byte < 128) return value;
      scale *= 128;
    }
  }

  difference() {
    const value = this.number();
    return value % 2 ? -(value + 1) / 2 : value / 2;
  }

  step() {
    if (this.frame + 1 >= this.frames) return;
    for (const mesh of this.meshes) {
      const before = mesh.slots;
      mesh.slots = this.number();
      if (3 * mesh.slots > mesh.corners.length) {
        const larger = new Uint32Array(Math.max(3 * mesh.slots, 2 * mesh.corners.length));
        larger.set(mesh.corners);
        mesh.corners = larger;
        mesh.ranges = null;
      }
      // Slots that come have no face until one is put there; there may have been one before.
      if (mesh.slots > before) {
        mesh.corners.fill(0, 3 * before, 3 * mesh.slots);
        if (mesh.ranges) mesh.ranges.push([before, mesh.slots]);
      }
      let slot = 0;
      let corner = 0;
      for (let count = this.number(); count > 0; count--) {
        slot += this.number();
        for (let k = 0; k < 3; k++) {
          corner += this.difference();
          mesh.corners[3 * slot + k] = corner;
        }
        if (mesh.ranges) {
          const last = mesh.ranges[mesh.ranges.length - 1];
          if (last && slot >= last[0] && slot <= last[1] + 64) last[1] = Math.max(last[1], slot + 1);
          else mesh.ranges.push([slot, slot + 1]);
        }
        slot++;
      }
      let vertex = 0;
      let place = 0;
      for (let count = this.number(); count > 0; count--) {
        vertex += this.number();
        place += this.difference();
        mesh.at[vertex] = place;
        if (mesh.vertices) mesh.vertices.push(vertex);
        vertex++;
      }
    }
    this.frame++;
    if (this.frame % this.spacing === 0 && !this.keys[this.frame / this.spacing]) this.keep();
  }

  // A keyframe, made when its frame is first reached: the file needs none.
  keep() {
    const meshes = this.meshes.map((m) => ({
      slots: m.slots,
      corners: m.corners.slice(0, 3 * m.slots),
      at: m.at.slice(),
    }));
    if (this.frame === 0) {
      const size = meshes.reduce((sum, m) => sum + m.corners.byteLength + m.at.byteLength, 0);
      this.spacing = Math.max(32, Math.ceil((this.frames * size) / 64e6));
    }
    this.keys[this.frame / this.spacing] = { position: this.position, meshes };
  }

  seek(frame) {
    frame = Math.max(0, Math.min(this.frames - 1, frame));
    let k = Math.min(Math.floor(frame / this.spacing), this.keys.length - 1);
    while (k >= 0 && !this.keys[k]) k--;
    if (k >= 0 && (frame < this.frame || k * this.spacing > this.frame)) {
      const key = this.keys[k];
      this.meshes.forEach((m, i) => {
        m.slots = key.meshes[i].slots;
        m.corners.set(key.meshes[i].corners);
        m.at.set(key.meshes[i].at);
        m.ranges = m.vertices = null;
      });
      this.position = key.position;
      this.frame = k * this.spacing;
    }
    while (this.frame < frame) this.step();
  }

  forget() {
    for (const m of this.meshes) m.ranges = m.vertices = null;
  }
}

const readRecording = async (bytes) => {
  const blocks = blocksOf(bytes);
  const header = JSON.parse(new TextDecoder().decode(await inflate(blocks[0])));
  const frames = header.cameras.length;
  const tracks = [];
  for (let k = 0; k < header.tracks.length; k++) {
    tracks.push(new Track(await inflate(blocks[1 + k]), header.meshes, frames));
  }
  const places = [];
  for (let m = 0; m < header.meshes.length; m++) {
    const block = await inflate(blocks[1 + header.tracks.length + m]);
    places.push(placesOf(block, header.meshes[m].places));
  }
  return { header, tracks, places };
};
