"use strict";
// Plays a response: outlines and poses come packed in the page, nothing is fetched.
(async () => {
  const $ = (id) => document.getElementById(id);
  const fail = (text) => { $("failure").textContent = text; };
  const model = JSON.parse($("model").textContent);
  if (typeof DecompressionStream === "undefined") {
    fail("This page needs a browser from 2023 or later to unpack its data.");
    return;
  }

  async function unpack(text) {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  }

  // Integers stored as differences along the first axis, low bytes of all first: such planes pack well.
  function integers(bytes, rows, columns) {
    const n = rows * columns, values = new Int32Array(n);
    for (let i = 0; i < n; i++) {
      values[i] = bytes[i] | (bytes[n + i] << 8) | (bytes[2 * n + i] << 16) | (bytes[3 * n + i] << 24);
      if (i >= columns) values[i] += values[i - columns];
    }
    return values;
  }

  const raw = {};
  for (const [name, part] of Object.entries(model.packed)) {
    raw[name] = integers(await unpack(part.data), part.rows, part.columns);
  }
  const scaled = (name, unit) => Float64Array.from(raw[name], (v) => v * unit);
  const nBlocks = model.names.length, nFrames = model.frames.length;
  const q = model.unit, origin = model.origin;
  const vertices = scaled("vertices", q), offsets = raw.offsets, centroids = scaled("centroids", q);
  const travel = scaled("travel", q), turn = scaled("turn", model.turn_unit);
  const joints = { blocks: raw.joint_blocks, ends: scaled("joint_ends", q), n: model.packed.joint_blocks.rows };
  const forces = { place: scaled("force_place", q), vector: scaled("force_vector", model.force_unit), first: raw.force_first };
  const live = { tail: scaled("live_tail", q), tip: scaled("live_tip", q), first: raw.live_first };
  const marks = { place: scaled("mark_place", q), kind: raw.mark_kind, first: raw.mark_first };

  const state = { frame: 0, playing: false, clock: 0, magnify: 1, forces: false, view: null, hover: -1 };
  const canvas = $("blocks"), context = canvas.getContext("2d");
  const corners = new Float64Array(vertices.length), pose = new Float64Array(nBlocks * 3);

  function poseAt(position) {
    const k = Math.min(Math.floor(position), nFrames - 1), t = position - k, next = Math.min(k + 1, nFrames - 1);
    const m = state.magnify;
    for (let b = 0; b < nBlocks; b++) {
      const i = (k * nBlocks + b), j = (next * nBlocks + b);
      const ux = travel[2 * i] * (1 - t) + travel[2 * j] * t, uy = travel[2 * i + 1] * (1 - t) + travel[2 * j + 1] * t;
      pose[3 * b] = m * ux; pose[3 * b + 1] = m * uy; pose[3 * b + 2] = m * (turn[i] * (1 - t) + turn[j] * t);
    }
    for (let b = 0; b < nBlocks; b++) {
      const c = Math.cos(pose[3 * b + 2]), s = Math.sin(pose[3 * b + 2]), x0 = centroids[2 * b], y0 = centroids[2 * b + 1];
      for (let v = offsets[b]; v < offsets[b + 1]; v++) {
        const x = vertices[2 * v] - x0, y = vertices[2 * v + 1] - y0;
        corners[2 * v] = x0 + pose[3 * b] + c * x - s * y;
        corners[2 * v + 1] = y0 + pose[3 * b + 1] + s * x + c * y;
      }
    }
  }

  // Where a point of the drawing, riding on a block, is now.
  function carried(b, x, y) {
    const c = Math.cos(pose[3 * b + 2]), s = Math.sin(pose[3 * b + 2]), dx = x - centroids[2 * b], dy = y - centroids[2 * b + 1];
    return [centroids[2 * b] + pose[3 * b] + c * dx - s * dy, centroids[2 * b + 1] + pose[3 * b + 1] + s * dx + c * dy];
  }

  function fit() {
    const [x0, y0, x1, y1] = model.bounds, w = canvas.clientWidth, h = canvas.clientHeight;
    const scale = Math.min(w / (x1 - x0), h / (y1 - y0));
    state.view = { scale, x: w / 2 - scale * (x0 + x1) / 2, y: h / 2 + scale * (y0 + y1) / 2 };
  }

  function sharp(target) {
    const ratio = window.devicePixelRatio || 1, w = target.clientWidth, h = target.clientHeight;
    if (target.width !== Math.round(w * ratio) || target.height !== Math.round(h * ratio)) {
      target.width = Math.round(w * ratio); target.height = Math.round(h * ratio);
    }
    const pen = target.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, w, h);
    return pen;
  }

  const px = (x) => state.view.x + state.view.scale * x, py = (y) => state.view.y - state.view.scale * y;

  function path(pen, points, first, last) {
    pen.beginPath();
    for (let v = first; v < last; v++) {
      if (v === first) pen.moveTo(px(points[2 * v]), py(points[2 * v + 1])); else pen.lineTo(px(points[2 * v]), py(points[2 * v + 1]));
    }
    pen.closePath();
  }

  function hatch() {
    const tile = document.createElement("canvas");
    tile.width = tile.height = 9;
    const pen = tile.getContext("2d");
    pen.fillStyle = model.colours.support; pen.fillRect(0, 0, 9, 9);
    pen.strokeStyle = model.colours.hatch; pen.lineWidth = 1;
    pen.beginPath(); pen.moveTo(-1, 10); pen.lineTo(10, -1); pen.moveTo(-1, 1); pen.lineTo(1, -1); pen.moveTo(8, 10); pen.lineTo(10, 8); pen.stroke();
    return context.createPattern(tile, "repeat");
  }
  const support = hatch();

  function cracks(pen, falling) {
    // In a fall in time blocks part and meet anew: what lay between two of them is no joint any more.
    if (falling && !model.joints_of_fall) return new Path2D();
    const [widest, widestFalling, steepest] = model.widest;
    pen.fillStyle = pen.strokeStyle = model.colours.open;
    pen.lineWidth = 1.6;
    const lines = new Path2D();
    for (let j = 0; j < joints.n; j++) {
      const a = joints.blocks[2 * j], b = joints.blocks[2 * j + 1], e = 4 * j;
      const ends = [[joints.ends[e], joints.ends[e + 1]], [joints.ends[e + 2], joints.ends[e + 3]]];
      const [a0, a1] = ends.map((p) => carried(a, ...p)), [b0, b1] = ends.map((p) => carried(b, ...p));
      const length = Math.hypot(ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]);
      // The outward normal of block b: its face runs from the first end to the second.
      const nx = (b1[1] - b0[1]) / length, ny = -(b1[0] - b0[0]) / length;
      const open = Math.max((a0[0] - b0[0]) * nx + (a0[1] - b0[1]) * ny, (a1[0] - b1[0]) * nx + (a1[1] - b1[1]) * ny);
      const apart = Math.min(Math.hypot(a0[0] - b0[0], a0[1] - b0[1]), Math.hypot(a1[0] - b1[0], a1[1] - b1[1]));
      if (open < model.smallest_opening * state.magnify) continue;
      const wide = apart / state.magnify, bent = Math.abs(pose[3 * a + 2] - pose[3 * b + 2]) / state.magnify;
      if (falling ? wide > widestFalling * length || bent > steepest : wide > Math.max(length, widest)) continue;
      const ring = [a0, a1, b1, b0];
      pen.beginPath();
      ring.forEach(([x, y], i) => (i ? pen.lineTo(px(x), py(y)) : pen.moveTo(px(x), py(y))));
      pen.closePath(); pen.fill();
      lines.moveTo(px((a0[0] + b0[0]) / 2), py((a0[1] + b0[1]) / 2));
      lines.lineTo(px((a1[0] + b1[0]) / 2), py((a1[1] + b1[1]) / 2));
    }
    return lines;
  }

  function draw() {
    const pen = sharp(canvas);
    if (!state.view) fit();
    poseAt(state.frame);
    const near = Math.min(Math.round(state.frame), nFrames - 1), falling = model.frames[near].falling;
    const lines = cracks(pen, falling);
    pen.lineJoin = "round";
    pen.strokeStyle = model.colours.outline;
    pen.lineWidth = Math.max(0.4, Math.min(1.1, model.block_size * state.view.scale / 25));
    for (let b = 0; b < nBlocks; b++) {
      path(pen, corners, offsets[b], offsets[b + 1]);
      pen.fillStyle = model.roles[b] ? support : model.fills[b];
      pen.fill(); pen.stroke();
    }
    pen.strokeStyle = model.colours.open; pen.lineWidth = 1.6; pen.stroke(lines);
    if (state.hover >= 0) {
      path(pen, corners, offsets[state.hover], offsets[state.hover + 1]);
      pen.strokeStyle = model.colours.settlement; pen.lineWidth = 2.5; pen.stroke();
    }
    // Marks stand at true scale; magnified, they would not lie on their blocks.
    if (state.magnify === 1 && Math.abs(state.frame - near) < 0.5) {
      if (state.forces && !falling) drawForces(pen, near);
      drawMarks(pen, near);
      drawLive(pen, near);
    }
    scaleBar(pen);
    words(near);
    drawCurve(near);
  }

  function drawForces(pen, k) {
    pen.strokeStyle = model.colours.force; pen.lineWidth = 2; pen.lineCap = "round";
    pen.beginPath();
    for (let i = forces.first[k]; i < forces.first[k + 1]; i++) {
      const x = forces.place[2 * i], y = forces.place[2 * i + 1];
      const dx = forces.vector[2 * i] * model.force_length / 2, dy = forces.vector[2 * i + 1] * model.force_length / 2;
      pen.moveTo(px(x - dx), py(y - dy)); pen.lineTo(px(x + dx), py(y + dy));
    }
    pen.stroke();
  }

  function drawMarks(pen, k) {
    const radius = Math.max(2.2, Math.min(6.5, 0.09 * model.block_size * state.view.scale));
    for (let i = marks.first[k]; i < marks.first[k + 1]; i++) {
      const x = px(marks.place[2 * i]), y = py(marks.place[2 * i + 1]), sliding = marks.kind[i] === 2;
      pen.beginPath(); pen.arc(x, y, radius, 0, 2 * Math.PI);
      pen.fillStyle = sliding ? model.colours.sliding : model.colours.hinge;
      pen.strokeStyle = "#fff"; pen.lineWidth = 1.5; pen.stroke(); pen.fill();
    }
  }

  function drawLive(pen, k) {
    pen.strokeStyle = pen.fillStyle = model.colours.live; pen.lineWidth = 2.5; pen.lineCap = "butt";
    for (let i = live.first[k]; i < live.first[k + 1]; i++) {
      const [x0, y0, x1, y1] = [px(live.tail[2 * i]), py(live.tail[2 * i + 1]), px(live.tip[2 * i]), py(live.tip[2 * i + 1])];
      const length = Math.hypot(x1 - x0, y1 - y0), ux = (x1 - x0) / length, uy = (y1 - y0) / length, head = Math.min(9, 0.6 * length);
      if (length < 2) continue;
      pen.beginPath(); pen.moveTo(x0, y0); pen.lineTo(x1 - head * ux, y1 - head * uy); pen.stroke();
      pen.beginPath(); pen.moveTo(x1, y1);
      pen.lineTo(x1 - head * ux - 0.5 * head * uy, y1 - head * uy + 0.5 * head * ux);
      pen.lineTo(x1 - head * ux + 0.5 * head * uy, y1 - head * uy - 0.5 * head * ux);
      pen.closePath(); pen.fill();
    }
  }

  function scaleBar(pen) {
    const most = 0.25 * canvas.clientWidth / state.view.scale, power = 10 ** Math.floor(Math.log10(most));
    const length = [5, 2, 1].map((m) => m * power).find((m) => m <= most), wide = length * state.view.scale;
    const x = 14, y = canvas.clientHeight - 14;
    pen.strokeStyle = pen.fillStyle = model.colours.ink; pen.lineWidth = 2; pen.lineCap = "butt";
    pen.beginPath(); pen.moveTo(x, y - 5); pen.lineTo(x, y + 5); pen.moveTo(x, y); pen.lineTo(x + wide, y);
    pen.moveTo(x + wide, y - 5); pen.lineTo(x + wide, y + 5); pen.stroke();
    pen.font = "14px system-ui, DejaVu Sans, sans-serif"; pen.textAlign = "center"; pen.textBaseline = "bottom";
    pen.fillText(`${+length.toPrecision(3)} m`, x + wide / 2, y - 7);
    if (!state.forces || state.magnify !== 1) return;
    const start = x + wide + 34, [force, text] = model.force_scale, bar = force * model.force_length * state.view.scale;
    pen.strokeStyle = model.colours.force; pen.beginPath(); pen.moveTo(start, y); pen.lineTo(start + bar, y); pen.stroke();
    pen.textAlign = "left"; pen.fillText(text, start, y - 7);
  }

  function words(k) {
    const frame = model.frames[k];
    $("caption").textContent = frame.caption;
    $("badge").style.display = frame.falling ? "inline" : "none";
    $("frame").value = k;
    document.body.dataset.frame = k;
    let checksum = 0;
    for (let i = 0; i < corners.length; i++) checksum = (checksum + corners[i] * (i % 97 + 1)) % 1e6;
    document.body.dataset.corners = checksum.toFixed(9);
  }

  function drawCurve(k) {
    const target = $("curve"), pen = sharp(target), w = target.clientWidth, h = target.clientHeight, c = model.curve;
    if (!c.settlement.length) return;
    const left = 62, right = 12, top = 14, bottom = 44, [xMin, xMax, yLow, yHigh] = [c.x_min, c.x_max || 1, c.y_min, c.y_max];
    const X = (s) => left + (w - left - right) * (s - xMin) / (xMax - xMin), Y = (r) => h - bottom - (h - top - bottom) * (r - yLow) / (yHigh - yLow);
    pen.font = "12.5px system-ui, DejaVu Sans, sans-serif"; pen.lineWidth = 1;
    pen.strokeStyle = "#e4e4e4"; pen.fillStyle = model.colours.ink;
    pen.textAlign = "right"; pen.textBaseline = "middle";
    for (const tick of c.y_ticks) {
      pen.beginPath(); pen.moveTo(left, Y(tick)); pen.lineTo(w - right, Y(tick)); pen.stroke();
      pen.fillText(`${tick}`, left - 6, Y(tick));
    }
    pen.textAlign = "center"; pen.textBaseline = "top";
    for (const tick of c.x_ticks) {
      pen.beginPath(); pen.moveTo(X(tick), top); pen.lineTo(X(tick), h - bottom); pen.stroke();
      pen.fillText(`${tick}`, X(tick), h - bottom + 5);
    }
    pen.fillText(c.x_label, (left + w - right) / 2, h - 17);
    pen.save(); pen.translate(13, (h - bottom + top) / 2); pen.rotate(-Math.PI / 2); pen.textBaseline = "middle"; pen.fillText(c.y_label, 0, 0); pen.restore();
    pen.strokeStyle = model.colours.force; pen.lineWidth = 2; pen.lineJoin = "round"; pen.beginPath();
    pen.save(); pen.beginPath(); pen.rect(left - 3, top - 3, w - left - right + 6, h - top - bottom + 6); pen.clip(); pen.beginPath();
    // An unbounded multiplier is null: the line stops before it and starts again after it.
    c.settlement.forEach((s, i) => {
      if (c.reaction[i] === null) return;
      if (i && c.reaction[i - 1] !== null) pen.lineTo(X(s), Y(c.reaction[i])); else pen.moveTo(X(s), Y(c.reaction[i]));
    });
    pen.stroke(); pen.restore();
    if (c.collapse !== null) {
      pen.strokeStyle = model.colours.warning; pen.lineWidth = 1; pen.setLineDash([5, 4]);
      pen.beginPath(); pen.moveTo(X(c.collapse), top); pen.lineTo(X(c.collapse), h - bottom); pen.stroke(); pen.setLineDash([]);
    }
    const at = Math.min(model.frames[k].curve, c.settlement.length - 1);
    pen.fillStyle = model.frames[k].falling ? model.colours.warning : model.colours.settlement;
    pen.beginPath(); if (c.reaction[at] !== null && c.reaction[at] <= yHigh) pen.arc(X(c.settlement[at]), Y(c.reaction[at]), 5.5, 0, 2 * Math.PI); pen.fill();
    state.curveX = X;
  }

  function show(frame) {
    state.frame = Math.max(0, Math.min(nFrames - 1, frame));
    draw();
  }

  function stop() { state.playing = false; $("play").textContent = "▶ Play"; }

  function step(now) {
    if (!state.playing) return;
    state.clock += Math.min(0.1, (now - state.last) / 1000); state.last = now;
    const times = model.times;
    if (state.clock >= times[nFrames - 1]) { show(nFrames - 1); stop(); return; }
    let k = 0;
    while (times[k + 1] <= state.clock) k++;
    show(k + (state.clock - times[k]) / (times[k + 1] - times[k]));
    requestAnimationFrame(step);
  }

  function play() {
    if (state.playing) { stop(); return; }
    if (state.frame >= nFrames - 1) state.frame = 0;
    state.playing = true; state.clock = model.times[Math.floor(state.frame)]; state.last = performance.now();
    $("play").textContent = "❚❚ Pause";
    requestAnimationFrame(step);
  }

  function blockAt(x, y) {
    const wx = (x - state.view.x) / state.view.scale, wy = (state.view.y - y) / state.view.scale;
    for (let b = nBlocks - 1; b >= 0; b--) {
      let inside = false;
      for (let v = offsets[b], w = offsets[b + 1] - 1; v < offsets[b + 1]; w = v++) {
        const x0 = corners[2 * v], y0 = corners[2 * v + 1], x1 = corners[2 * w], y1 = corners[2 * w + 1];
        if ((y0 > wy) !== (y1 > wy) && wx < x0 + (x1 - x0) * (wy - y0) / (y1 - y0)) inside = !inside;
      }
      if (inside) return b;
    }
    return -1;
  }

  function hover(event) {
    const tip = $("tip"), b = blockAt(event.offsetX, event.offsetY);
    if (b !== state.hover) { state.hover = b; draw(); }
    if (b < 0) { tip.style.display = "none"; return; }
    const m = state.magnify, mm = (v) => (1000 * v / m).toFixed(2);
    const size = Math.hypot(pose[3 * b], pose[3 * b + 1]);
    const kind = ["free", "fixed support", "moving support"][model.roles[b]];
    tip.textContent = `${model.names[b]}${model.materials[b] ? " · " + model.materials[b] : ""} · ${kind}\n` +
      `displacement ${mm(size)} mm (${mm(pose[3 * b])}, ${mm(pose[3 * b + 1])})\nrotation ${(1000 * pose[3 * b + 2] / m).toFixed(2)} mrad`;
    tip.style.display = "block";
    tip.style.left = `${Math.min(event.offsetX + 14, canvas.clientWidth - tip.offsetWidth - 6)}px`;
    tip.style.top = `${Math.min(event.offsetY + 14, canvas.clientHeight - tip.offsetHeight - 6)}px`;
  }

  let grip = null;
  canvas.addEventListener("pointerdown", (e) => { grip = [e.clientX, e.clientY]; canvas.setPointerCapture(e.pointerId); });
  canvas.addEventListener("pointerup", () => { grip = null; });
  canvas.addEventListener("pointerleave", () => { $("tip").style.display = "none"; if (state.hover >= 0) { state.hover = -1; draw(); } });
  canvas.addEventListener("pointermove", (e) => {
    if (!grip) { hover(e); return; }
    state.view.x += e.clientX - grip[0]; state.view.y += e.clientY - grip[1]; grip = [e.clientX, e.clientY];
    draw();
  });
  canvas.addEventListener("wheel", (e) => {
    e.preventDefault();
    const factor = Math.exp(-e.deltaY * 0.0015), v = state.view;
    v.x = e.offsetX + (v.x - e.offsetX) * factor; v.y = e.offsetY + (v.y - e.offsetY) * factor; v.scale *= factor;
    draw();
  }, { passive: false });
  canvas.addEventListener("dblclick", () => { fit(); draw(); });
  $("fit").addEventListener("click", () => { fit(); draw(); });
  $("play").addEventListener("click", play);
  $("frame").addEventListener("input", () => { stop(); show(Number($("frame").value)); });
  $("forces").addEventListener("change", () => { state.forces = $("forces").checked; draw(); });
  $("magnify").addEventListener("input", () => { const m = Number($("magnify").value); if (m > 0) { state.magnify = m; draw(); } });
  $("curve").addEventListener("click", (e) => {
    if (!state.curveX) return;
    let best = 0, nearest = Infinity;
    model.frames.forEach((f, k) => {
      const d = f.falling ? Infinity : Math.abs(state.curveX(model.curve.settlement[Math.min(f.curve, model.curve.settlement.length - 1)]) - e.offsetX);
      if (d < nearest) { nearest = d; best = k; }
    });
    stop(); show(best);
  });
  document.addEventListener("keydown", (e) => {
    if (e.target.tagName === "INPUT" && e.target.type !== "range") return;
    if (e.key === " " && e.target.tagName !== "BUTTON") { e.preventDefault(); play(); }
    if (e.key === "ArrowRight" && e.target.type !== "range") { stop(); show(Math.floor(state.frame) + 1); }
    if (e.key === "ArrowLeft" && e.target.type !== "range") { stop(); show(Math.ceil(state.frame) - 1); }
  });
  window.addEventListener("resize", () => { fit(); draw(); });

  // #frame=12&forces=1&magnify=10 opens the page as one wants to show it.
  function wanted() {
    const asked = new URLSearchParams(location.hash.slice(1));
    if (asked.has("forces")) state.forces = $("forces").checked = asked.get("forces") !== "0";
    if (Number(asked.get("magnify")) > 0) { state.magnify = Number(asked.get("magnify")); $("magnify").value = state.magnify; }
    show(asked.has("frame") ? Number(asked.get("frame")) || 0 : state.frame);
    if (asked.get("play") === "1" && !state.playing) play();
  }
  window.addEventListener("hashchange", wanted);

  $("frame").max = nFrames - 1;
  $("legend").append(...model.legend.flatMap(([kind, text, colour]) => {
    const key = document.createElement("span"), label = document.createElement("span");
    key.className = `key ${kind}`; key.style.background = colour; label.textContent = text;
    return [key, label];
  }));
  wanted();
  document.body.dataset.ready = "1";
})();
