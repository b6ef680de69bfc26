"use strict";
// The page: what is shown, and what buttons, keys and fingers do.

const $ = (id) => document.getElementById(id);
const THEMES = {
  light: { around: [0.87, 0.87, 0.88], background: [1, 1, 1], surface: [0.62, 0.66, 0.7], inside: [0.85, 0.68, 0.45], line: [0.08, 0.1, 0.14], frustum: [0.75, 0.2, 0.1] },
  dark: { around: [0.06, 0.06, 0.07], background: [0.11, 0.11, 0.13], surface: [0.6, 0.65, 0.7], inside: [0.88, 0.7, 0.42], line: [0.02, 0.02, 0.03], frustum: [1, 0.5, 0.35] },
};

const start = async () => {
  const recording = await readRecording(bytesOf($("flight").textContent));
  const { header, tracks } = recording;
  const frames = header.cameras.length;
  const canvas = $("canvas");
  const renderer = new Renderer(canvas, recording);
  const [lo, hi] = header.bounds;
  const centre = add(lo, hi).map((x) => x / 2);
  const radius = Math.max(Math.hypot(...add(hi, lo, -1)) / 2, 1e-30);
  // The outside view: around the middle, far enough to have the frozen camera in it.
  const eyes = header.cameras.reduce((most, c) => Math.max(most, Math.hypot(...add(c.eye, centre, -1))), radius);
  const orbit = { turn: 0.9, rise: 0.5, distance: 2.6 * Math.max(radius, Math.min(eyes, 3 * radius)) };
  const state = { frame: 0, track: Math.max(0, tracks.findIndex((_, k) => header.tracks[k].asked)), playing: false, outside: false, wire: false, speed: 1, theme: null };

  const dark = matchMedia("(prefers-color-scheme: dark)");
  const theme = () => state.theme ?? (dark.matches ? "dark" : "light");
  const group = (n) => n.toLocaleString("en");

  const outsideCamera = () => {
    const up = header.up;
    const east = unit(cross(Math.abs(up[2]) > 0.5 ? [0, 1, 0] : [0, 0, 1], up));
    const north = cross(up, east);
    const level = add(east.map((x) => x * Math.sin(orbit.turn)), north, Math.cos(orbit.turn));
    const out = add(level.map((x) => x * Math.cos(orbit.rise)), up, Math.sin(orbit.rise));
    const look = out.map((x) => -x);
    const right = unit(cross(look, up));
    return {
      eye: add(centre, out, orbit.distance), look, right, up: cross(right, look),
      half: Math.tan(Math.PI / 8), perspective: true, size: [1, 1],
      near: 0.005 * orbit.distance, far: orbit.distance + 8 * Math.max(radius, eyes),
    };
  };

  // As far as the scene: the farthest corner of its box.
  const reachOf = (c) => {
    let most = 2 * c.near;
    for (let k = 0; k < 8; k++) most = Math.max(most, dot(add([0, 1, 2].map((i) => (k >> i & 1 ? hi[i] : lo[i])), c.eye, -1), c.look));
    return most;
  };

  let pending = false;
  const refresh = () => {
    if (pending) return;
    pending = true;
    requestAnimationFrame(show);
  };
  let last = 0;
  const show = (now) => {
    pending = false;
    if (state.playing) {
      state.frame += Math.min((now - last) / 1000, 0.1) * 30 * state.speed;
      if (state.frame >= frames) state.frame = 0;
    }
    last = now;
    const frame = Math.floor(state.frame);
    const track = tracks[state.track];
    track.seek(frame);
    const frozen = header.cameras[frame];
    const camera = state.outside ? outsideCamera() : frozen;
    renderer.draw(track, camera, frozen, { ...THEMES[theme()], wire: state.wire, reach: reachOf(frozen) });
    const [faces, vertices, splits, collapses, morphing, tau] = header.tracks[state.track].counts[frame];
    $("counts").textContent =
      `frame ${group(frame * header.stride)} of ${group(frames * header.stride)} · ${group(faces)} of ${group(header.full_faces)} faces · ` +
      `${group(vertices)} vertices · +${group(splits)} −${group(collapses)}` +
      (morphing ? ` · ${group(morphing)} on the way` : "") + ` · tau ${tau === null ? "∞" : +tau.toPrecision(3)} px`;
    $("scrub").value = frame;
    if (state.playing) refresh();
  };

  const buttons = () => {
    $("play").textContent = state.playing ? "Pause" : "Play";
    $("outside").setAttribute("aria-pressed", state.outside);
    $("wire").setAttribute("aria-pressed", state.wire);
    const tau = header.tracks[state.track].tau;
    $("tau-now").textContent = `tau ${tau === null ? "∞" : +tau.toPrecision(3)} px`;
    $("tau").value = state.track;
    $("speed").textContent = `${state.speed}×`;
    document.documentElement.dataset.theme = theme();
    refresh();
  };
  const actions = {
    play() { state.playing = !state.playing; last = performance.now(); },
    outside() { state.outside = !state.outside; },
    wire() { state.wire = !state.wire; },
    theme() { state.theme = theme() === "dark" ? "light" : "dark"; },
    speed() { state.speed = { 1: 2, 2: 4, 4: 0.25, 0.25: 0.5, 0.5: 1 }[state.speed]; },
    go(frame) { state.playing = false; state.frame = Math.max(0, Math.min(frames - 1, Math.floor(frame))); },
    tau(k) {
      k = Math.max(0, Math.min(tracks.length - 1, k));
      if (k === state.track) return;
      state.track = k;
      tracks[k].forget();
      renderer.renew();
    },
  };
  const act = (name, ...rest) => { actions[name](...rest); buttons(); };

  $("scrub").max = frames - 1;
  $("tau").max = tracks.length - 1;
  $("tau").disabled = tracks.length < 2;
  for (const name of ["play", "outside", "wire", "theme", "speed"]) $(name).onclick = () => act(name);
  $("scrub").oninput = (e) => act("go", +e.target.value);
  $("tau").oninput = (e) => act("tau", +e.target.value);
  dark.addEventListener("change", buttons);
  addEventListener("resize", refresh);
  addEventListener("keydown", (e) => {
    if (e.ctrlKey || e.metaKey || e.altKey) return;
    // A focused slider keeps its arrows, a focused button its space.
    const kind = document.activeElement?.tagName;
    const by = e.shiftKey ? 10 : 1;
    const keys = {
      " ": () => kind !== "BUTTON" && act("play"),
      ArrowRight: () => kind !== "INPUT" && act("go", state.frame + by),
      ArrowLeft: () => kind !== "INPUT" && act("go", state.frame - by),
      Home: () => act("go", 0), End: () => act("go", frames - 1),
      w: () => act("wire"), o: () => act("outside"), t: () => act("theme"), s: () => act("speed"),
      "[": () => act("tau", state.track - 1), "]": () => act("tau", state.track + 1),
    };
    const key = keys[e.key] ?? keys[e.key.toLowerCase()];
    if (key && key() !== false) e.preventDefault();
  });

  // Dragging looks from outside; two fingers and the wheel go nearer.
  const fingers = new Map();
  canvas.onpointerdown = (e) => {
    canvas.setPointerCapture(e.pointerId);
    fingers.set(e.pointerId, [e.clientX, e.clientY]);
  };
  canvas.onpointermove = (e) => {
    const before = fingers.get(e.pointerId);
    if (!before) return;
    const spread = () => {
      const [a, b] = [...fingers.values()];
      return b ? Math.hypot(a[0] - b[0], a[1] - b[1]) : 0;
    };
    const wide = spread();
    fingers.set(e.pointerId, [e.clientX, e.clientY]);
    if (!state.outside) act("outside");
    if (wide > 0) {
      zoom(wide / Math.max(spread(), 1));
    } else {
      orbit.turn -= 0.008 * (e.clientX - before[0]);
      orbit.rise = Math.max(-1.5, Math.min(1.5, orbit.rise + 0.008 * (e.clientY - before[1])));
    }
    refresh();
  };
  canvas.onpointerup = canvas.onpointercancel = (e) => fingers.delete(e.pointerId);
  const zoom = (factor) => {
    orbit.distance = Math.max(0.02 * radius, Math.min(40 * Math.max(radius, eyes), orbit.distance * factor));
    refresh();
  };
  canvas.addEventListener("wheel", (e) => {
    e.preventDefault();
    if (!state.outside) act("outside");
    zoom(Math.exp(0.0015 * e.deltaY));
  }, { passive: false });

  $("message").remove();
  buttons();
  // For tests, and for the curious.
  globalThis.player = { recording, state, act, renderer };
};

start().catch((e) => {
  $("message").textContent = `This flight cannot be played: ${e.message}. It needs WebGL 2 and DecompressionStream, which browsers have had since 2023.`;
});
