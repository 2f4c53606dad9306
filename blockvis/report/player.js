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
  const q = model.unit;
  const vertices = scaled("vertices", q), offsets = raw.offsets, centroids = scaled("centroids", q);
  const travel = scaled("travel", q), turn = scaled("turn", model.turn_unit);
  const joints = { blocks: raw.joint_blocks, ends: scaled("joint_ends", q), n: model.packed.joint_blocks.rows };
  const forces = { place: scaled("force_place", q), vector: scaled("force_vector", model.force_unit), blocks: raw.force_blocks, first: raw.force_first };
  const live = { tail: scaled("live_tail", q), tip: scaled("live_tip", q), first: raw.live_first };
  const marks = { place: scaled("mark_place", q), kind: raw.mark_kind, first: raw.mark_first };
  const jointsOf = Array.from({ length: nBlocks }, () => []);
  for (let j = 0; j < joints.n; j++) { jointsOf[joints.blocks[2 * j]].push(j); jointsOf[joints.blocks[2 * j + 1]].push(j); }

  const state = { frame: 0, playing: false, clock: 0, magnify: 1, speed: 1, colours: "material", view: null, hover: -1, joint: -1 };
  const layers = { cracks: true, hinges: !model.many, sliding: !model.many, forces: false, thrust: false, start: true };
  const canvas = $("blocks");
  const corners = new Float64Array(vertices.length), pose = new Float64Array(nBlocks * 3), shown = new Float64Array(nBlocks * 3);
  const still = window.matchMedia("(prefers-reduced-motion: reduce)"), dark = window.matchMedia("(prefers-color-scheme: dark)");

  const LIGHT = { paper: "#ffffff", ink: model.colours.ink, grid: "#e4e4e4", ghost: "#8a8a8a" };
  const DARK = { paper: "#17191c", ink: "#e6e6e6", grid: "#3a3d42", ghost: "#9a9a9a" };
  const theme = () => (dark.matches ? DARK : LIGHT);

  // pose: true displacements and rotations; shown and corners: those times the magnification.
  function poseAt(position) {
    const k = Math.min(Math.floor(position), nFrames - 1), t = position - k, next = Math.min(k + 1, nFrames - 1);
    for (let b = 0; b < nBlocks; b++) {
      const i = (k * nBlocks + b), j = (next * nBlocks + b);
      pose[3 * b] = travel[2 * i] * (1 - t) + travel[2 * j] * t;
      pose[3 * b + 1] = travel[2 * i + 1] * (1 - t) + travel[2 * j + 1] * t;
      pose[3 * b + 2] = turn[i] * (1 - t) + turn[j] * t;
    }
    for (let i = 0; i < pose.length; i++) shown[i] = state.magnify * pose[i];
    for (let b = 0; b < nBlocks; b++) {
      const c = Math.cos(shown[3 * b + 2]), s = Math.sin(shown[3 * b + 2]), x0 = centroids[2 * b], y0 = centroids[2 * b + 1];
      for (let v = offsets[b]; v < offsets[b + 1]; v++) {
        const x = vertices[2 * v] - x0, y = vertices[2 * v + 1] - y0;
        corners[2 * v] = x0 + shown[3 * b] + c * x - s * y;
        corners[2 * v + 1] = y0 + shown[3 * b + 1] + s * x + c * y;
      }
    }
  }

  // Where a point of the drawing, riding on a block, is at a pose.
  function carried(at, b, x, y) {
    const c = Math.cos(at[3 * b + 2]), s = Math.sin(at[3 * b + 2]), dx = x - centroids[2 * b], dy = y - centroids[2 * b + 1];
    return [centroids[2 * b] + at[3 * b] + c * dx - s * dy, centroids[2 * b + 1] + at[3 * b + 1] + s * dx + c * dy];
  }

  const norm = Math.hypot;
  // The faces of a joint at a pose: ends on both blocks, opening, slip, normal from block b into block a.
  function faces(at, j) {
    const a = joints.blocks[2 * j], b = joints.blocks[2 * j + 1], e = joints.ends;
    const ends = [[e[4 * j], e[4 * j + 1]], [e[4 * j + 2], e[4 * j + 3]]];
    const [a0, a1] = ends.map((p) => carried(at, a, ...p)), [b0, b1] = ends.map((p) => carried(at, b, ...p));
    const length = norm(ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]);
    // The outward normal of block b: its face runs from the first end to the second.
    const nx = (b1[1] - b0[1]) / length, ny = -(b1[0] - b0[0]) / length;
    const across = [[a0, b0], [a1, b1]].map(([p, r]) => (p[0] - r[0]) * nx + (p[1] - r[1]) * ny);
    const along = [[a0, b0], [a1, b1]].map(([p, r]) => (p[1] - r[1]) * nx - (p[0] - r[0]) * ny);
    const closer = Math.abs(across[0]) <= Math.abs(across[1]) ? 0 : 1;
    const apart = Math.min(norm(a0[0] - b0[0], a0[1] - b0[1]), norm(a1[0] - b1[0], a1[1] - b1[1]));
    return { a, b, a0, a1, b0, b1, length, nx, ny, opening: Math.max(...across), slip: along[closer], apart, bent: Math.abs(at[3 * a + 2] - at[3 * b + 2]) };
  }

  // Resultant of a joint on its block a: normal force, compression positive, and shear force; null where there is none.
  function forceOf(k, face) {
    if (model.frames[k].falling) return null;
    const low = Math.min(face.a, face.b), high = Math.max(face.a, face.b);
    for (let i = forces.first[k]; i < forces.first[k + 1]; i++) {
      if (forces.blocks[2 * i] !== low || forces.blocks[2 * i + 1] !== high) continue;
      const sign = face.a === low ? 1 : -1, fx = sign * forces.vector[2 * i], fy = sign * forces.vector[2 * i + 1];
      return [fx * face.nx + fy * face.ny, -fx * face.ny + fy * face.nx];
    }
    return [0, 0];
  }

  const MARGIN = 36;
  function fitted(w, h) {
    const [x0, y0, x1, y1] = model.bounds, scale = Math.min(w / (x1 - x0), (h - MARGIN) / (y1 - y0));
    return { scale, x: w / 2 - scale * (x0 + x1) / 2, y: (h - MARGIN) / 2 + scale * (y0 + y1) / 2 };
  }
  function fit() { state.view = fitted(canvas.clientWidth, canvas.clientHeight); }

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

  function ring(pen, points) {
    pen.beginPath();
    points.forEach(([x, y], i) => (i ? pen.lineTo(px(x), py(y)) : pen.moveTo(px(x), py(y))));
    pen.closePath();
  }

  function outline(pen, points, b) {
    pen.beginPath();
    for (let v = offsets[b]; v < offsets[b + 1]; v++) {
      if (v === offsets[b]) pen.moveTo(px(points[2 * v]), py(points[2 * v + 1])); else pen.lineTo(px(points[2 * v]), py(points[2 * v + 1]));
    }
    pen.closePath();
  }

  function lineBetween(pen, ends) {
    pen.beginPath();
    for (const [x0, y0, x1, y1] of ends) { pen.moveTo(px(x0), py(y0)); pen.lineTo(px(x1), py(y1)); }
    pen.stroke();
  }

  function hatch() {
    const tile = document.createElement("canvas"), pen = tile.getContext("2d");
    tile.width = tile.height = 9;
    pen.fillStyle = model.colours.support; pen.fillRect(0, 0, 9, 9);
    pen.strokeStyle = model.colours.hatch; pen.lineWidth = 0.9;
    pen.beginPath();
    for (const x of [-9, 0, 9]) { pen.moveTo(x - 1, 10); pen.lineTo(x + 10, -1); }
    pen.stroke();
    return canvas.getContext("2d").createPattern(tile, "repeat");
  }
  const support = hatch();

  function fillOf(b, vector) {
    if (model.roles[b]) return vector ? model.colours.support : support;
    if (state.colours === "mechanism" && model.tints.length) return model.tints[b];
    if (state.colours === "displacement") {
      const part = norm(pose[3 * b], pose[3 * b + 1]) / (model.largest_displacement || 1);
      return mixed(Math.max(0, Math.min(1, part)));
    }
    return model.fills[b];
  }

  function mixed(part) {
    const at = part * (model.ramp.length - 1), k = Math.min(Math.floor(at), model.ramp.length - 2);
    const rgb = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
    const [low, high] = [rgb(model.ramp[k]), rgb(model.ramp[k + 1])];
    return `rgb(${low.map((v, i) => Math.round(v + (high[i] - v) * (at - k))).join(",")})`;
  }

  // Fills the open joints; returns the middle lines of those too narrow to be seen as areas.
  function drawCracks(pen) {
    const lines = [], [widest, steepest] = model.widest;
    pen.fillStyle = model.colours.open;
    for (let j = 0; j < joints.n; j++) {
      const f = faces(shown, j), m = state.magnify;
      // Blocks that have parted have no joint any more: what lies between them is air.
      if (f.opening < model.smallest_opening * m || f.apart > m * Math.min(f.length, widest)) continue;
      state.cracks++;
      // A wedge that gapes is open to the room: its faces have the colour.
      if (f.bent > m * steepest) { lines.push([...f.a0, ...f.a1], [...f.b0, ...f.b1]); continue; }
      ring(pen, [f.a0, f.a1, f.b1, f.b0]);
      pen.fill();
      if (f.opening * state.view.scale < 12) lines.push([(f.a0[0] + f.b0[0]) / 2, (f.a0[1] + f.b0[1]) / 2, (f.a1[0] + f.b1[0]) / 2, (f.a1[1] + f.b1[1]) / 2]);
    }
    return lines;
  }

  // Everything in the picture; pen is that of a canvas, or one that writes SVG.
  function paint(pen, w, h, colours) {
    const near = Math.min(Math.round(state.frame), nFrames - 1), falling = model.frames[near].falling;
    pen.lineJoin = "round"; pen.lineCap = "butt";
    if (model.ground !== null) {
      pen.strokeStyle = model.colours.hatch; pen.lineWidth = 1.5;
      pen.beginPath(); pen.moveTo(0, py(model.ground)); pen.lineTo(w, py(model.ground)); pen.stroke();
    }
    if (layers.start) drawStart(pen, colours);
    state.cracks = 0;
    const lines = layers.cracks && (!falling || model.joints_of_fall) ? drawCracks(pen) : [];
    pen.strokeStyle = model.colours.outline;
    pen.lineWidth = Math.max(0.4, Math.min(1.1, model.block_size * state.view.scale / 25));
    for (let b = 0; b < nBlocks; b++) {
      outline(pen, corners, b);
      pen.fillStyle = fillOf(b, pen instanceof SvgPen);
      pen.fill(); pen.stroke();
    }
    pen.strokeStyle = model.colours.open; pen.lineWidth = 1.6; lineBetween(pen, lines);
    if (state.hover >= 0) {
      outline(pen, corners, state.hover);
      pen.strokeStyle = model.colours.settlement; pen.lineWidth = 3; pen.stroke();
    }
    if (layers.start && !falling) drawArrows(pen, near);
    // Marks stand at true scale; magnified, they would not lie on their blocks.
    if (state.magnify === 1 && Math.abs(state.frame - near) < 0.5) {
      if (layers.sliding) drawSliding(pen, near);
      if (!falling) drawForces(pen, near);
      if (layers.hinges) drawHinges(pen, near);
      drawLive(pen, near);
    }
    scaleBar(pen, w, h, colours);
  }

  function drawStart(pen, colours) {
    pen.strokeStyle = colours.ghost; pen.lineWidth = 1.2; pen.setLineDash([5, 4]);
    for (let b = 0; b < nBlocks; b++) if (model.roles[b] === 2) { outline(pen, vertices, b); pen.stroke(); }
    pen.setLineDash([]);
  }

  function arrow(pen, x0, y0, x1, y1, colour, width) {
    const length = norm(x1 - x0, y1 - y0), ux = (x1 - x0) / length, uy = (y1 - y0) / length, head = Math.min(3.6 * width, 0.6 * length);
    if (length < 2) return;
    pen.strokeStyle = pen.fillStyle = colour; pen.lineWidth = width; pen.lineCap = "butt";
    pen.beginPath(); pen.moveTo(x0, y0); pen.lineTo(x1 - head * ux, y1 - head * uy); pen.stroke();
    pen.beginPath(); pen.moveTo(x1, y1);
    pen.lineTo(x1 - head * ux - 0.5 * head * uy, y1 - head * uy + 0.5 * head * ux);
    pen.lineTo(x1 - head * ux + 0.5 * head * uy, y1 - head * uy - 0.5 * head * ux);
    pen.closePath(); pen.fill();
  }

  // Which way the supports go in this phase.
  function drawArrows(pen, k) {
    for (const [b, x, y, dx, dy] of model.arrows[model.frames[k].phase] || []) {
      const [cx, cy] = carried(shown, b, x, y), long = 22;
      arrow(pen, px(cx) - long * dx, py(cy) + long * dy, px(cx) + long * dx, py(cy) - long * dy, model.colours.settlement, 5);
    }
  }

  function drawForces(pen, k) {
    pen.strokeStyle = model.colours.force; pen.lineCap = "round";
    if (layers.forces) {
      const bars = [];
      for (let i = forces.first[k]; i < forces.first[k + 1]; i++) {
        const x = forces.place[2 * i], y = forces.place[2 * i + 1];
        const dx = forces.vector[2 * i] * model.force_length / 2, dy = forces.vector[2 * i + 1] * model.force_length / 2;
        bars.push([x - dx, y - dy, x + dx, y + dy]);
      }
      pen.lineWidth = 2; lineBetween(pen, bars);
    }
    if (layers.thrust) { pen.lineWidth = 3; lineBetween(pen, thrustLine(k)); }
  }

  // From joint to joint, where every free block has two at most: an arch, a column.
  function thrustLine(k) {
    const met = Array.from({ length: nBlocks }, () => []);
    for (let i = forces.first[k]; i < forces.first[k + 1]; i++) for (const b of [forces.blocks[2 * i], forces.blocks[2 * i + 1]]) if (!model.roles[b]) met[b].push(i);
    if (met.some((of) => of.length > 2)) return [];
    return met.filter((of) => of.length === 2).map(([i, j]) => [forces.place[2 * i], forces.place[2 * i + 1], forces.place[2 * j], forces.place[2 * j + 1]]);
  }

  function drawHinges(pen, k) {
    const radius = Math.max(2.2, Math.min(6.5, 0.09 * model.block_size * state.view.scale));
    for (let i = marks.first[k]; i < marks.first[k + 1]; i++) {
      if (marks.kind[i] !== 1) continue;
      pen.beginPath(); pen.arc(px(marks.place[4 * i]), py(marks.place[4 * i + 1]), radius, 0, 2 * Math.PI);
      pen.fillStyle = model.colours.hinge; pen.strokeStyle = "#fff"; pen.lineWidth = 1.5; pen.stroke(); pen.fill();
    }
  }

  function drawSliding(pen, k) {
    const ends = [];
    for (let i = marks.first[k]; i < marks.first[k + 1]; i++) if (marks.kind[i] === 2) ends.push([...marks.place.slice(4 * i, 4 * i + 4)]);
    pen.strokeStyle = model.colours.sliding; pen.lineWidth = 3.5; pen.lineCap = "round"; lineBetween(pen, ends);
  }

  function drawLive(pen, k) {
    for (let i = live.first[k]; i < live.first[k + 1]; i++) {
      arrow(pen, px(live.tail[2 * i]), py(live.tail[2 * i + 1]), px(live.tip[2 * i]), py(live.tip[2 * i + 1]), model.colours.live, 2.5);
    }
  }

  const FONT = "system-ui, DejaVu Sans, sans-serif";
  function scaleBar(pen, w, h, colours) {
    const most = 0.25 * w / state.view.scale, power = 10 ** Math.floor(Math.log10(most));
    const length = [5, 2, 1].map((m) => m * power).find((m) => m <= most), wide = length * state.view.scale;
    const x = 14, y = h - 9;
    // On paper of its own: blocks that are dragged there would hide it.
    pen.fillStyle = colours.paper; pen.fillRect(0, h - MARGIN + 2, w, MARGIN - 2);
    pen.strokeStyle = pen.fillStyle = colours.ink; pen.lineWidth = 2; pen.lineCap = "butt";
    pen.beginPath(); pen.moveTo(x, y - 5); pen.lineTo(x, y + 5); pen.moveTo(x, y); pen.lineTo(x + wide, y);
    pen.moveTo(x + wide, y - 5); pen.lineTo(x + wide, y + 5); pen.stroke();
    pen.font = `14px ${FONT}`; pen.textAlign = "center"; pen.textBaseline = "bottom";
    pen.fillText(`${+length.toPrecision(3)} m`, x + wide / 2, y - 5);
    const falling = model.frames[Math.min(Math.round(state.frame), nFrames - 1)].falling;
    if (!layers.forces || falling || state.magnify !== 1) return;
    const start = x + wide + 34, [force, text] = model.force_scale, bar = force * model.force_length * state.view.scale;
    pen.strokeStyle = model.colours.force; pen.beginPath(); pen.moveTo(start, y); pen.lineTo(start + bar, y); pen.stroke();
    pen.textAlign = "left"; pen.fillText(text, start, y - 5);
  }

  function draw() {
    const pen = sharp(canvas);
    if (!state.view) fit();
    poseAt(state.frame);
    paint(pen, canvas.clientWidth, canvas.clientHeight, theme());
    const near = Math.min(Math.round(state.frame), nFrames - 1);
    words(near);
    legend(near);
    drawCurve(near);
  }

  function countOf(k, kind) {
    let n = 0;
    for (let i = marks.first[k]; i < marks.first[k + 1]; i++) n += marks.kind[i] === kind;
    return n;
  }

  function words(k) {
    const frame = model.frames[k];
    $("state").setAttribute("aria-live", state.playing ? "off" : "polite");
    if ($("caption").textContent !== frame.caption) $("caption").textContent = frame.caption;
    $("badge").style.display = frame.falling ? "inline" : "none";
    $("frame").value = k;
    $("frame").setAttribute("aria-valuetext", frame.caption + (frame.falling ? ", no equilibrium" : ""));
    $("hinges-text").textContent = `hinges (${countOf(k, 1)})`;
    $("sliding-text").textContent = `sliding joints (${countOf(k, 2)})`;
    document.body.dataset.frame = k;
    let checksum = 0;
    for (let i = 0; i < corners.length; i++) checksum = (checksum + corners[i] * (i % 97 + 1)) % 1e6;
    document.body.dataset.corners = checksum.toFixed(9);
  }

  // The legend lists what is in the picture, and says what is too much for it.
  function legend(k) {
    const falling = model.frames[k].falling, entries = [];
    const add = (kind, text, colour) => entries.push([kind, text, colour]);
    const marked = state.magnify === 1;
    if (state.cracks) add("area", "open joint", model.colours.open);
    if (layers.hinges && marked && countOf(k, 1)) add("dot", "hinge", model.colours.hinge);
    if (layers.sliding && marked && countOf(k, 2)) add("line", "sliding joint", model.colours.sliding);
    if (layers.forces && marked && !falling && model.has_forces) add("line", "resultant of a joint", model.colours.force);
    if (layers.thrust && marked && !falling && thrustLine(k).length) add("line", "thrust line", model.colours.force);
    if (layers.start && model.arrows.length) add("line", falling ? "dashed: where the support was" : "settlement; dashed: where the support was", falling ? model.colours.hatch : model.colours.settlement);
    if (marked && model.live_words) add("line", model.live_words, model.colours.live);
    if (state.colours === "mechanism" && model.tints.length) add("area", model.tints_words, model.tints[model.moving]);
    if (state.colours === "displacement") add("ramp", `displacement, 0 to ${(1000 * model.largest_displacement).toPrecision(3)} mm`, `linear-gradient(90deg, ${model.ramp.join(",")})`);
    const many = [["hinges", 1], ["sliding", 2]].filter(([name, kind]) => model.many && countOf(k, kind) && !layers[name]);
    if (many.length) add("", `${many.map(([name]) => (name === "hinges" ? "hinges" : "sliding joints")).join(" and ")} are off: they would hide the cracks of so many blocks`, "");
    if (!marked) add("", "hinges, sliding joints and forces are shown at true scale only", "");
    const told = JSON.stringify(entries);
    if ($("legend").dataset.told === told) return;
    $("legend").dataset.told = told;
    $("legend").replaceChildren(...entries.map(([kind, text, colour]) => {
      const item = document.createElement("li"), label = document.createElement("span");
      if (kind) {
        const key = document.createElement("span");
        key.className = `key ${kind}`; key.style.background = colour; item.append(key);
      }
      label.textContent = text; item.append(label);
      return item;
    }));
  }

  function drawCurve(k) {
    const target = $("curve"), pen = sharp(target);
    paintCurve(pen, target.clientWidth, target.clientHeight, k, theme());
  }

  function paintCurve(pen, w, h, k, colours) {
    const c = model.curve;
    if (!c.settlement.length) return;
    const left = 62, right = 12, top = 14, bottom = 44, [xMin, xMax, yLow, yHigh] = c.single ? [0, 1, c.y_min, c.y_max] : [c.x_min, c.x_max || 1, c.y_min, c.y_max];
    const X = (s) => left + (w - left - right) * (s - xMin) / (xMax - xMin), Y = (r) => h - bottom - (h - top - bottom) * (r - yLow) / (yHigh - yLow);
    pen.font = `12.5px ${FONT}`; pen.lineWidth = 1; pen.lineCap = "butt";
    pen.strokeStyle = colours.grid; pen.fillStyle = colours.ink;
    pen.textAlign = "right"; pen.textBaseline = "middle";
    for (const tick of c.y_ticks) {
      pen.beginPath(); pen.moveTo(left, Y(tick)); pen.lineTo(w - right, Y(tick)); pen.stroke();
      pen.fillText(`${tick}`, left - 6, Y(tick));
    }
    pen.textAlign = "center"; pen.textBaseline = "top";
    for (const tick of c.single ? [] : c.x_ticks) {
      pen.beginPath(); pen.moveTo(X(tick), top); pen.lineTo(X(tick), h - bottom); pen.stroke();
      pen.fillText(`${tick}`, X(tick), h - bottom + 5);
    }
    pen.fillText(c.single ? "displacement of the mechanism, any size" : c.x_label, (left + w - right) / 2, h - 17);
    pen.save(); pen.translate(13, (h - bottom + top) / 2); pen.rotate(-Math.PI / 2); pen.textBaseline = "middle"; pen.fillText(c.y_label, 0, 0); pen.restore();
    pen.strokeStyle = dark.matches && colours === DARK ? "#6aa9e0" : model.colours.force; pen.lineWidth = 2; pen.lineJoin = "round";
    pen.save(); pen.beginPath(); pen.rect(left - 3, top - 3, w - left - right + 6, h - top - bottom + 6); pen.clip(); pen.beginPath();
    if (c.single && c.reaction[0] !== null) { pen.moveTo(X(0), Y(0)); pen.lineTo(X(0), Y(c.reaction[0])); pen.lineTo(X(1), Y(c.reaction[0])); }
    // An unbounded multiplier is null: the line stops before it and starts again after it.
    if (!c.single) c.settlement.forEach((s, i) => {
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
    pen.beginPath();
    if (c.reaction[at] !== null && c.reaction[at] <= yHigh) pen.arc(c.single ? X(model.frames[k].falling ? 0.5 : 0) : X(c.settlement[at]), Y(c.reaction[at]), 5.5, 0, 2 * Math.PI);
    pen.fill();
    state.curveX = c.single ? null : X;
  }

  function show(frame) {
    state.frame = Math.max(0, Math.min(nFrames - 1, frame));
    draw();
    if (state.hover >= 0 && $("tip").style.display === "block") tell();
  }

  function stop() { state.playing = false; $("play").textContent = "▶ Play"; $("state").setAttribute("aria-live", "polite"); }

  function step(now) {
    if (!state.playing) return;
    state.clock += state.speed * Math.min(0.1, (now - state.last) / 1000); state.last = now;
    const times = model.times;
    if (state.clock >= times[nFrames - 1]) { show(nFrames - 1); stop(); return; }
    let k = 0;
    while (times[k + 1] <= state.clock) k++;
    const between = (state.clock - times[k]) / (times[k + 1] - times[k]);
    // Asked for less motion: one picture after the other, twice a second, and nothing glides.
    if (!still.matches) show(k + between);
    else if (!(now - state.shown < 500)) { state.shown = now; show(k); }
    requestAnimationFrame(step);
  }

  function play() {
    if (state.playing) { stop(); return; }
    if (state.frame >= nFrames - 1) state.frame = 0;
    const k = Math.floor(state.frame);
    state.playing = true; state.shown = -1e9; state.last = performance.now();
    state.clock = model.times[k] + (state.frame - k) * ((model.times[k + 1] || model.times[k]) - model.times[k]);
    $("play").textContent = "❚❚ Pause";
    requestAnimationFrame(step);
  }

  const world = (x, y) => [(x - state.view.x) / state.view.scale, (state.view.y - y) / state.view.scale];

  function blockAt(x, y) {
    const [wx, wy] = world(x, y);
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

  // The joint of a block that is nearest to a place, if it is within reach of a finger.
  function jointAt(b, x, y) {
    let best = -1, least = 12;
    for (const j of jointsOf[b] || []) {
      const f = faces(shown, j), x0 = px((f.a0[0] + f.b0[0]) / 2), y0 = py((f.a0[1] + f.b0[1]) / 2);
      const dx = px((f.a1[0] + f.b1[0]) / 2) - x0, dy = py((f.a1[1] + f.b1[1]) / 2) - y0;
      const t = Math.max(0, Math.min(1, ((x - x0) * dx + (y - y0) * dy) / (dx * dx + dy * dy || 1)));
      const away = norm(x - x0 - t * dx, y - y0 - t * dy);
      if (away < least) { least = away; best = j; }
    }
    return best;
  }

  function newtons(value) {
    const size = Math.abs(value), [factor, unit] = size >= 1e6 ? [1e6, "MN"] : size >= 1e3 ? [1e3, "kN"] : [1, "N"];
    return `${+(value / factor).toPrecision(3)} ${unit}`;
  }

  const millimetres = (v) => (1000 * v).toFixed(2);
  function jointText(j, b) {
    const f = faces(pose, j), other = f.a === b ? f.b : f.a;
    const force = forceOf(Math.min(Math.round(state.frame), nFrames - 1), f);
    const carries = force === null ? "no equilibrium" : `N ${newtons(force[0])}, T ${newtons(force[1])}`;
    return `joint with ${model.names[other]}: opening ${millimetres(Math.max(0, f.opening))} mm, slip ${millimetres(Math.abs(f.slip))} mm, ${carries}`;
  }

  const MOST_JOINTS = 6;
  function blockText(b) {
    const size = norm(pose[3 * b], pose[3 * b + 1]);
    const kind = ["free", "fixed support", "moving support"][model.roles[b]];
    const own = jointsOf[b].map((j) => [j === state.joint ? Infinity : faces(pose, j).opening, j]).sort((one, two) => two[0] - one[0]).map(([, j]) => j);
    const more = own.length > MOST_JOINTS ? `\nand ${own.length - MOST_JOINTS} more joints` : "";
    return `${model.names[b]}${model.materials[b] ? " · " + model.materials[b] : ""} · ${kind}\n` +
      `displacement ${millimetres(size)} mm (${millimetres(pose[3 * b])}, ${millimetres(pose[3 * b + 1])})\nrotation ${(1000 * pose[3 * b + 2]).toFixed(2)} mrad` +
      own.slice(0, MOST_JOINTS).map((j) => `\n${jointText(j, b)}`).join("") + more;
  }

  function tell(x, y) {
    const tip = $("tip"), b = state.hover;
    tip.textContent = blockText(b);
    tip.style.display = "block";
    if (x === undefined) return;
    tip.style.left = `${Math.max(6, Math.min(x + 14, canvas.clientWidth - tip.offsetWidth - 6))}px`;
    tip.style.top = `${Math.max(6, Math.min(y + 14, canvas.clientHeight - tip.offsetHeight - 6))}px`;
  }

  function letGo() {
    $("tip").style.display = "none"; state.joint = -1;
    if (state.hover >= 0) { state.hover = -1; draw(); }
  }

  function pick(x, y) {
    const b = blockAt(x, y);
    if (b < 0) { letGo(); return; }
    state.joint = jointAt(b, x, y);
    if (b !== state.hover) { state.hover = b; draw(); }
    tell(x, y);
  }

  // The keyboard's way to a block: one after the other.
  function nextBlock(by) {
    state.hover = state.hover < 0 ? (by > 0 ? 0 : nBlocks - 1) : (state.hover + by + nBlocks) % nBlocks;
    state.joint = -1;
    draw();
    const [x, y] = carried(shown, state.hover, centroids[2 * state.hover], centroids[2 * state.hover + 1]);
    tell(px(x), py(y));
    canvas.setAttribute("aria-label", `The blocks. ${$("tip").textContent.replaceAll("\n", "; ")}`);
  }

  function zoom(factor, x = canvas.clientWidth / 2, y = canvas.clientHeight / 2) {
    const v = state.view;
    v.x = x + (v.x - x) * factor; v.y = y + (v.y - y) * factor; v.scale *= factor;
    draw();
  }

  // One finger scrolls the page up and down and tells about a block; two zoom; the mouse drags.
  const fingers = new Map();
  const spread = () => { const [p, r] = [...fingers.values()]; return [norm(p[0] - r[0], p[1] - r[1]), (p[0] + r[0]) / 2, (p[1] + r[1]) / 2]; };
  canvas.addEventListener("pointerdown", (e) => {
    fingers.set(e.pointerId, [e.offsetX, e.offsetY]);
    if (e.pointerType === "touch") pick(e.offsetX, e.offsetY); else canvas.setPointerCapture(e.pointerId);
  });
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (e) => { fingers.delete(e.pointerId); });
  canvas.addEventListener("pointerleave", (e) => { fingers.delete(e.pointerId); if (e.pointerType !== "touch") letGo(); });
  canvas.addEventListener("pointermove", (e) => {
    const before = fingers.get(e.pointerId);
    if (!before) { pick(e.offsetX, e.offsetY); return; }
    const two = fingers.size === 2, was = two ? spread() : null;
    fingers.set(e.pointerId, [e.offsetX, e.offsetY]);
    if (two) {
      const now = spread();
      state.view.x += now[1] - was[1]; state.view.y += now[2] - was[2];
      zoom(now[0] / (was[0] || 1), now[1], now[2]);
    } else if (e.pointerType !== "touch") {
      state.view.x += e.offsetX - before[0]; state.view.y += e.offsetY - before[1];
      draw();
    }
  });
  canvas.addEventListener("wheel", (e) => {
    // Without Ctrl the wheel is the page's.
    if (!e.ctrlKey && !e.metaKey) return;
    e.preventDefault();
    zoom(Math.exp(-e.deltaY * (e.deltaMode ? 0.05 : 0.003)), e.offsetX, e.offsetY);
  }, { passive: false });
  canvas.addEventListener("dblclick", () => { fit(); draw(); });
  canvas.addEventListener("blur", letGo);
  canvas.addEventListener("keydown", (e) => {
    if (e.ctrlKey || e.metaKey || e.altKey) return;
    const pan = { ArrowLeft: [40, 0], ArrowRight: [-40, 0], ArrowUp: [0, 40], ArrowDown: [0, -40] }[e.key];
    if (e.key === "+" || e.key === "=") zoom(1.25);
    else if (e.key === "-") zoom(0.8);
    else if (e.key === "0") { fit(); draw(); }
    else if (e.key === "n" || e.key === "N") nextBlock(1);
    else if (e.key === "p" || e.key === "P") nextBlock(-1);
    else if (e.key === "Escape") letGo();
    else if (e.shiftKey && pan) { state.view.x += pan[0]; state.view.y += pan[1]; draw(); e.stopPropagation(); }
    else return;
    e.preventDefault();
  });
  $("fit").addEventListener("click", () => { fit(); draw(); });
  $("closer").addEventListener("click", () => zoom(1.25));
  $("farther").addEventListener("click", () => zoom(0.8));
  $("play").addEventListener("click", play);
  $("back").addEventListener("click", () => { stop(); show(Math.ceil(state.frame) - 1); });
  $("forth").addEventListener("click", () => { stop(); show(Math.floor(state.frame) + 1); });
  $("speed").addEventListener("change", () => { state.speed = Number($("speed").value); });
  $("frame").addEventListener("input", () => { stop(); show(Number($("frame").value)); });
  for (const name of Object.keys(layers)) {
    $(name).checked = layers[name];
    $(name).addEventListener("change", () => { layers[name] = $(name).checked; draw(); });
  }
  for (const name of ["material", "displacement", "mechanism"]) $(name).addEventListener("change", () => { state.colours = name; draw(); });
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
    const at = e.target.tagName;
    if (e.ctrlKey || e.metaKey || e.altKey || at === "SELECT" || (at === "INPUT" && e.target.type !== "range" && e.key !== " ")) return;
    if (e.key === " " && !["BUTTON", "INPUT", "SUMMARY"].includes(at)) { e.preventDefault(); play(); }
    if (at === "INPUT" || e.shiftKey) return;
    const to = { ArrowRight: Math.floor(state.frame) + 1, ArrowLeft: Math.ceil(state.frame) - 1, Home: 0, End: nFrames - 1 }[e.key];
    // Home and End belong to the page, except in the picture.
    if (to === undefined || (e.key.length < 5 && e.target !== canvas)) return;
    e.preventDefault(); stop(); show(to);
  });
  window.addEventListener("resize", () => { fit(); draw(); });
  dark.addEventListener("change", draw);

  // A pen that takes the calls above and writes SVG.
  class SvgPen {
    constructor() { this.out = []; this.d = ""; this.dash = ""; this.at = ""; this.stack = []; this.fillStyle = this.strokeStyle = "#000"; this.lineWidth = 1; this.lineCap = "butt"; this.lineJoin = "round"; this.font = ""; this.textAlign = "left"; this.textBaseline = "alphabetic"; }
    static number(v) { return String(+v.toFixed(2)); }
    beginPath() { this.d = ""; }
    moveTo(x, y) { this.d += `M${SvgPen.number(x)} ${SvgPen.number(y)}`; }
    lineTo(x, y) { this.d += `L${SvgPen.number(x)} ${SvgPen.number(y)}`; }
    closePath() { this.d += "Z"; }
    arc(x, y, r) { const n = SvgPen.number; this.d += `M${n(x - r)} ${n(y)}a${n(r)} ${n(r)} 0 1 0 ${n(2 * r)} 0a${n(r)} ${n(r)} 0 1 0 ${n(-2 * r)} 0Z`; }
    setLineDash(dash) { this.dash = dash.length ? ` stroke-dasharray="${dash.join(" ")}"` : ""; }
    fill() { if (this.d) this.out.push(`<path d="${this.d}" fill="${this.fillStyle}"/>`); }
    stroke() { if (this.d) this.out.push(`<path d="${this.d}" fill="none" stroke="${this.strokeStyle}" stroke-width="${this.lineWidth}" stroke-linecap="${this.lineCap}" stroke-linejoin="round"${this.dash}/>`); }
    fillRect(x, y, w, h) { this.out.push(`<rect x="${x}" y="${y}" width="${w}" height="${h}" fill="${this.fillStyle}"/>`); }
    fillText(text, x, y) {
      const safe = text.replace(/[&<>"]/g, (c) => `&#${c.charCodeAt(0)};`), size = parseFloat(this.font) || 14;
      const anchor = { center: "middle", right: "end" }[this.textAlign] || "start", down = { middle: 0.35, top: 0.85 }[this.textBaseline] || 0;
      this.out.push(`<text x="${SvgPen.number(x)}" y="${SvgPen.number(y + down * size)}" font-size="${size}" font-family="system-ui, DejaVu Sans, sans-serif" text-anchor="${anchor}" fill="${this.fillStyle}">${safe}</text>`);
    }
  }

  const fileName = (end) => `${(model.name || "blockvis").replace(/[^\w.-]+/g, "_")}${end}`;
  function save(blob, name) {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob); link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60000);
  }

  // The picture as it is seen, on white paper, with its caption above.
  const HEAD = 34;
  function caption(pen, w) {
    const k = Math.min(Math.round(state.frame), nFrames - 1), falling = model.frames[k].falling;
    pen.fillStyle = LIGHT.ink; pen.font = `16px ${FONT}`; pen.textAlign = "left"; pen.textBaseline = "middle";
    pen.fillText(model.frames[k].caption + (falling ? `  ·  ${$("badge").textContent}` : ""), 14, HEAD / 2);
  }
  function shifted(work) {
    state.view.y += HEAD;
    try { work(); } finally { state.view.y -= HEAD; }
  }

  $("png").addEventListener("click", () => {
    const target = document.createElement("canvas"), w = canvas.clientWidth, h = canvas.clientHeight + HEAD, pen = target.getContext("2d");
    target.width = 2 * w; target.height = 2 * h;
    pen.scale(2, 2); pen.fillStyle = LIGHT.paper; pen.fillRect(0, 0, w, h);
    shifted(() => paint(pen, w, h, LIGHT));
    caption(pen, w);
    target.toBlob((blob) => save(blob, fileName(`_${Math.round(state.frame)}.png`)), "image/png");
  });
  $("svg").addEventListener("click", () => {
    const w = canvas.clientWidth, h = canvas.clientHeight + HEAD, pen = new SvgPen();
    pen.fillStyle = LIGHT.paper; pen.fillRect(0, 0, w, h);
    shifted(() => paint(pen, w, h, LIGHT));
    caption(pen, w);
    const text = `<svg xmlns="http://www.w3.org/2000/svg" width="${w}" height="${h}" viewBox="0 0 ${w} ${h}">\n${pen.out.join("\n")}\n</svg>\n`;
    save(new Blob([text], { type: "image/svg+xml" }), fileName(`_${Math.round(state.frame)}.svg`));
  });
  const field = (text) => (/[",\n\r]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  const table = (rows) => new Blob([rows.map((row) => row.map((v) => field(String(v ?? ""))).join(",")).join("\n") + "\n"], { type: "text/csv" });
  $("csv").addEventListener("click", () => {
    const c = model.curve;
    save(table([[c.x_label || "state", c.y_label], ...c.settlement.map((s, i) => [s, c.reaction[i]])]), fileName("_curve.csv"));
  });
  $("joints").addEventListener("click", () => {
    const k = Math.min(Math.round(state.frame), nFrames - 1);
    poseAt(k);
    const rows = [["joint", "opening [mm]", "slip [mm]", "N [N]", "T [N]"]];
    for (let j = 0; j < joints.n; j++) {
      const f = faces(pose, j), force = forceOf(k, f) || ["", ""];
      rows.push([`${model.names[f.a]} | ${model.names[f.b]}`, (1000 * f.opening).toFixed(4), (1000 * f.slip).toFixed(4), ...force.map((v) => (v === "" ? "" : v.toPrecision(4)))]);
    }
    draw();
    save(table(rows), fileName(`_joints_${k}.csv`));
  });

  // #frame=12&forces=1&magnify=10&colours=mechanism opens the page as one wants to show it.
  function wanted() {
    const asked = new URLSearchParams(location.hash.slice(1));
    for (const name of Object.keys(layers)) if (asked.has(name)) layers[name] = $(name).checked = asked.get(name) !== "0";
    if (["material", "displacement", "mechanism"].includes(asked.get("colours"))) { state.colours = asked.get("colours"); $(state.colours).checked = true; }
    if (Number(asked.get("magnify")) > 0) { state.magnify = Number(asked.get("magnify")); $("magnify").value = state.magnify; }
    show(asked.has("frame") ? Number(asked.get("frame")) || 0 : state.frame);
    if (asked.get("play") === "1" && !state.playing) play();
  }
  window.addEventListener("hashchange", wanted);

  $("frame").max = nFrames - 1;
  $("forces").disabled = !model.has_forces;
  $("mechanism").disabled = !model.tints.length;
  $("start").disabled = !model.arrows.length;
  const some = model.frames.findIndex((f) => !f.falling);
  $("thrust").disabled = some < 0 || !thrustLine(some).length;
  const c = model.curve, known = c.reaction.filter((v) => v !== null);
  if (known.length) $("curve").setAttribute("aria-label", `Curve: ${c.y_label} against ${c.x_label || "the mechanism"}, from ${known[0]} to ${known[known.length - 1]}, at most ${Math.max(...known)}`);
  $("blocks").setAttribute("aria-label", `The blocks: ${nBlocks}, of which ${model.roles.filter((r) => !r).length} are free`);
  wanted();
  document.body.dataset.ready = "1";
})();
