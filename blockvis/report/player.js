"use strict";
// Plays a response: shapes and poses come packed in the page, nothing is fetched. What draws the blocks, in the plane or
// in space, stands where SCENE is; it has poseAt, paint, fit, blockAt, jointAt, blockText, placeOf, dragged, nudged and faces,
// and fills corners.
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
  const q = model.unit, norm = Math.hypot;
  const state = { frame: 0, opened: true, playing: false, clock: 0, magnify: 1, speed: 1, colours: "material", view: null, hover: -1, joint: -1 };
  const layers = { cracks: true, hinges: !model.many, sliding: !model.many, forces: false, thrust: false, start: true };
  const canvas = $("blocks");
  const still = window.matchMedia("(prefers-reduced-motion: reduce)"), dark = window.matchMedia("(prefers-color-scheme: dark)");

  const LIGHT = { paper: "#ffffff", ink: model.colours.ink, grid: "#e4e4e4", ghost: "#8a8a8a" };
  const DARK = { paper: "#17191c", ink: "#e6e6e6", grid: "#3a3d42", ghost: "#9a9a9a" };
  const theme = () => (dark.matches ? DARK : LIGHT);

  // Blocks that have fallen or were taken away by each frame: their joints are no more, and they take the fill over them along.
  const gone = model.frames.map((frame) => new Set(frame.gone));
  const nearest = () => Math.min(Math.round(state.frame), nFrames - 1);
  const joined = (a, b) => { const now = gone[nearest()]; return !now.has(a) && !now.has(b); };
  // Those of them that have fallen are drawn where they began to.
  const lost = model.frames.map((frame) => new Set(frame.lost)), isLost = (b) => lost[nearest()].has(b);

  // Normal force, compression positive, and shear force of a joint on its block a; null where there is no equilibrium.
  // Stored are the steps from the smallest that is told, each by the same part of itself.
  function forceOf(k, j) {
    if (model.frames[k].falling) return null;
    const at = 2 * (k * joints.n + j), [smallest, step] = model.told_forces;
    return [raw.joint_forces[at], raw.joint_forces[at + 1]].map((v) => Math.sign(v) * smallest * Math.exp(step * Math.abs(v)));
  }

  // SCENE

  const MARGIN = 36;
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

  function mixed(part) {
    const at = part * (model.ramp.length - 1), k = Math.min(Math.floor(at), model.ramp.length - 2);
    const rgb = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
    const [low, high] = [rgb(model.ramp[k]), rgb(model.ramp[k + 1])];
    return `rgb(${low.map((v, i) => Math.round(v + (high[i] - v) * (at - k))).join(",")})`;
  }

  const loads = model.loads.map(([kind, words, colour]) => (
    { words, colour, tail: scaled(`${kind}_tail`, q), tip: scaled(`${kind}_tip`, q), first: raw[`${kind}_first`] }));
  function drawLoads(pen, k, onPage) {
    const d = model.space ? 3 : 2, place = (of, i) => onPage(of.slice(d * i, d * i + d));
    for (const { colour, tail, tip, first } of loads)
      for (let i = first[k]; i < first[k + 1]; i++) arrow(pen, ...place(tail, i), ...place(tip, i), colour, 2.5);
  }

  function spot(pen, x, y, radius, fill, rim) {
    pen.beginPath(); pen.arc(x, y, radius, 0, 2 * Math.PI);
    pen.fillStyle = fill; pen.strokeStyle = rim; pen.lineWidth = 1.5; pen.stroke(); pen.fill();
  }

  function arrow(pen, x0, y0, x1, y1, colour, width) {
    const length = norm(x1 - x0, y1 - y0), ux = (x1 - x0) / length, uy = (y1 - y0) / length, head = Math.min(3.6 * width, 0.6 * length);
    if (length < 2) return;
    const at = (along, across) => [x0 + along * ux - across * uy, y0 + along * uy + across * ux], neck = length - head, w = width / 2;
    pen.beginPath(); pen.moveTo(...at(0, w));
    for (const point of [[neck, w], [neck, head / 2], [length, 0], [neck, -head / 2], [neck, -w], [0, -w]]) pen.lineTo(...at(...point));
    // The rim shows on dark paper, and on blocks of its colour.
    pen.closePath(); pen.strokeStyle = "#fff"; pen.lineWidth = 1.5; pen.stroke(); pen.fillStyle = colour; pen.fill();
  }

  // Ties, props and bars of a frame, each with its force; placed says where a point is on the canvas.
  function drawTies(pen, k, colours, placed) {
    if (state.magnify !== 1 || Math.abs(state.frame - k) >= 0.5) return;
    const at = (p) => placed(p.map((v, i) => v - model.origin[i])), written = [];
    for (const tie of model.ties[k]) {
      const ends = tie.ends.map(at);
      pen.strokeStyle = pen.fillStyle = tie.colour; pen.lineWidth = tie.width; pen.lineCap = "butt"; pen.setLineDash(tie.dash);
      for (const [[x0, y0], [x1, y1]] of tie.lines.map((line) => line.map(at))) { pen.beginPath(); pen.moveTo(x0, y0); pen.lineTo(x1, y1); pen.stroke(); }
      pen.setLineDash([]);
      for (const [x, y] of ends) { pen.beginPath(); pen.arc(x, y, 1.2 * tie.width, 0, 2 * Math.PI); pen.fill(); }
      ends.forEach((end, i) => { if (tie.ground[i]) drawEarth(pen, end, ends[1 - i], colours); });
    }
    // Names over all lines, along their line where another name is in the way.
    pen.font = `13px ${FONT}`; pen.textAlign = "center"; pen.textBaseline = "middle"; pen.lineWidth = 1.2;
    for (const tie of model.ties[k]) {
      const [[x0, y0], [x1, y1]] = tie.ends.map(at), half = 4 * tie.words.length;
      const boxes = [0.5, 0.3, 0.7, 0.15, 0.85].map((t) => [x0 + t * (x1 - x0), y0 + t * (y1 - y0)]);
      const free = boxes.find(([x, y]) => written.every(([u, v, other]) => Math.abs(x - u) > half + other + 4 || Math.abs(y - v) > 22)) || boxes[0];
      const [x, y] = free;
      written.push([x, y, half]);
      pen.fillStyle = colours.paper; pen.strokeStyle = tie.colour;
      pen.beginPath(); pen.moveTo(x - half, y - 9); pen.lineTo(x + half, y - 9); pen.lineTo(x + half, y + 9); pen.lineTo(x - half, y + 9); pen.closePath();
      pen.fill(); pen.stroke();
      pen.fillStyle = colours.ink; pen.fillText(tie.words, x, y);
    }
  }

  // The ground that holds an end: a hatched plate across the line.
  function drawEarth(pen, [x, y], [u, v], colours) {
    const away = norm(x - u, y - v) || 1, ax = (x - u) / away, ay = (y - v) / away, wide = 10;
    pen.strokeStyle = colours.ink; pen.lineWidth = 1.6;
    pen.beginPath(); pen.moveTo(x + wide * ay, y - wide * ax); pen.lineTo(x - wide * ay, y + wide * ax);
    for (const share of [-0.9, -0.4, 0.1, 0.6]) {
      const p = x + share * wide * ay, r = y - share * wide * ax;
      pen.moveTo(p, r); pen.lineTo(p + 0.5 * wide * (ax + ay), r + 0.5 * wide * (ay - ax));
    }
    pen.stroke();
  }

  const FONT = "system-ui, DejaVu Sans, sans-serif";
  function scaleBar(pen, w, h, colours) {
    const most = 0.25 * w / state.view.scale;
    // A page that is not laid out yet has no scale.
    if (!(most > 0 && most < Infinity)) return;
    const power = 10 ** Math.floor(Math.log10(most));
    const length = [5, 2, 1].map((m) => m * power).find((m) => m <= most), wide = length * state.view.scale;
    const x = 14, y = h - 9;
    // On paper of its own: blocks that are dragged there would hide it.
    pen.fillStyle = colours.paper; pen.fillRect(0, h - MARGIN + 2, w, MARGIN - 2);
    pen.strokeStyle = pen.fillStyle = colours.ink; pen.lineWidth = 2; pen.lineCap = "butt";
    pen.beginPath(); pen.moveTo(x, y - 5); pen.lineTo(x, y + 5); pen.moveTo(x, y); pen.lineTo(x + wide, y);
    pen.moveTo(x + wide, y - 5); pen.lineTo(x + wide, y + 5); pen.stroke();
    pen.font = `14px ${FONT}`; pen.textAlign = "center"; pen.textBaseline = "bottom";
    const small = length < 0.0999, label = +(small ? 1e3 * length : length).toPrecision(3);
    pen.fillText(`${label} ${small ? "mm" : "m"}`, x + wide / 2, y - 5);
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
    if (state.cracks && model.space) add("ramp", `open joint, to ${+(1000 * model.widest_crack).toPrecision(3)} mm`, `linear-gradient(90deg, ${model.cracks.join(",")})`);
    else if (state.cracks) add("area", "open joint", model.colours.open);
    if (layers.hinges && marked && countOf(k, 1)) add(model.space ? "line" : "dot", model.space ? "hinge, faint where hidden" : "hinge", model.colours.hinge);
    if (marked && countOf(k, 3)) add("dot", "crushing", model.colours.crushing);
    if (layers.sliding && marked && countOf(k, 2)) add("line", "sliding joint", model.colours.sliding);
    if (layers.forces && marked && !falling && model.has_forces) add("line", "resultant of a joint", model.colours.force);
    if (layers.thrust && marked && !falling && thrustLine(k).length) add("line", "thrust line", model.colours.force);
    const was = `${model.space ? "thin" : "dashed"}: where the support was`;
    if (layers.start && model.arrows.length) add("line", falling ? was : `settlement; ${was}`, falling ? model.colours.hatch : model.colours.settlement);
    if (marked) for (const told of new Set(model.ties[k].map((tie) => JSON.stringify([tie.key, tie.colour])))) add("line", ...JSON.parse(told));
    if (model.fill && !falling && !model.space) add("area", "fill", model.fill.colours[1]);
    if (model.fill && !falling && model.space && marked) add("line", "edges of the fill", model.fill.colours[2]);
    if (model.fill && model.fill.words && marked && layers.forces && !falling) add("line", model.fill.words, model.fill.colours[2]);
    if (marked) for (const { words, colour, first } of loads) if (first[k] < first[k + 1]) add("line", words, colour);
    if (lost[k].size) add("area lost", "lost block", model.colours.lost);
    if (state.colours === "mechanism" && model.tints.length) add("area", model.tints_words, model.tints[model.moving]);
    if (state.colours === "displacement") add("ramp", `displacement, 0 to ${+(1000 * model.largest_displacement).toPrecision(3)} mm${falling ? " or more" : ""}`, `linear-gradient(90deg, ${model.ramp.join(",")})`);
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
    if (!model.tie_curves) return;
    const ties = $("tie-curve");
    paintTieCurves(sharp(ties), ties.clientWidth, ties.clientHeight, k, theme());
  }

  // Axes of a curve c over the settlement, with its labels; gives where numbers are on the canvas.
  function curveAxes(pen, w, h, c, colours) {
    const left = 62, right = 12, top = 14, bottom = 44, over = model.curve, [xMin, xMax] = over.single ? [0, 1] : [over.x_min, over.x_max || 1];
    const X = (s) => left + (w - left - right) * (s - xMin) / (xMax - xMin), Y = (r) => h - bottom - (h - top - bottom) * (r - c.y_min) / (c.y_max - c.y_min);
    pen.font = `12.5px ${FONT}`; pen.lineWidth = 1; pen.lineCap = "butt";
    pen.strokeStyle = colours.grid; pen.fillStyle = colours.ink;
    pen.textAlign = "right"; pen.textBaseline = "middle";
    for (const tick of c.y_ticks) {
      pen.beginPath(); pen.moveTo(left, Y(tick)); pen.lineTo(w - right, Y(tick)); pen.stroke();
      pen.fillText(`${tick}`, left - 6, Y(tick));
    }
    pen.textAlign = "center"; pen.textBaseline = "top";
    for (const tick of over.single ? [] : over.x_ticks) {
      pen.beginPath(); pen.moveTo(X(tick), top); pen.lineTo(X(tick), h - bottom); pen.stroke();
      pen.fillText(`${tick}`, X(tick), h - bottom + 5);
    }
    pen.fillText(over.single ? "displacement of the mechanism, any size" : over.x_label, (left + w - right) / 2, h - 17);
    pen.save(); pen.translate(13, (h - bottom + top) / 2); pen.rotate(-Math.PI / 2); pen.textBaseline = "middle"; pen.fillText(c.y_label, 0, 0); pen.restore();
    return { X, Y, left, right, top, bottom };
  }

  // Forces of the ties over the settlement, with the names at the end of the lines' colours.
  function paintTieCurves(pen, w, h, k, colours) {
    const c = model.tie_curves, { X, Y, left, top } = curveAxes(pen, w, h, c, colours), s = model.curve.settlement;
    const at = Math.min(model.frames[k].curve - model.curve.first, s.length - 1);
    pen.lineJoin = "round"; pen.textAlign = "left"; pen.textBaseline = "middle";
    let x = left + 4;
    for (const line of c.lines) {
      pen.strokeStyle = pen.fillStyle = line.colour; pen.lineWidth = 2;
      pen.beginPath();
      line.force.forEach((f, i) => { if (f !== null) (i && line.force[i - 1] !== null ? pen.lineTo(X(s[i]), Y(f)) : pen.moveTo(X(s[i]), Y(f))); });
      pen.moveTo(x, top - 7); pen.lineTo(x + 14, top - 7); pen.stroke();
      pen.fillStyle = colours.ink; pen.fillText(line.name, x + 18, top - 7); x += 32 + pen.measureText(line.name).width;
      if (at >= 0 && line.force[at] !== null) { pen.fillStyle = line.colour; pen.beginPath(); pen.arc(X(s[at]), Y(line.force[at]), 4.5, 0, 2 * Math.PI); pen.fill(); }
    }
  }

  function paintCurve(pen, w, h, k, colours) {
    const c = model.curve;
    if (!c.settlement.length) return;
    const { X, Y, left, right, top, bottom } = curveAxes(pen, w, h, c, colours), yHigh = c.y_max;
    pen.strokeStyle = dark.matches && colours === DARK ? "#6aa9e0" : model.colours.force; pen.lineWidth = 2; pen.lineJoin = "round";
    pen.save(); pen.beginPath(); pen.rect(left - 3, top - 3, w - left - right + 6, h - top - bottom + 6); pen.clip(); pen.beginPath();
    if (c.band.length) {
      pen.save(); pen.globalAlpha = 0.2; pen.fillStyle = pen.strokeStyle;
      c.band.forEach(([s, low], i) => i ? pen.lineTo(X(s), Y(low)) : pen.moveTo(X(s), Y(low)));
      c.band.slice().reverse().forEach(([s, , high]) => pen.lineTo(X(s), Y(high)));
      pen.closePath(); pen.fill(); pen.globalAlpha = 0.5; pen.lineWidth = 1; pen.stroke(); pen.restore(); pen.beginPath();
    }
    const leaps = [...(c.rest ? [1] : []), ...c.losses.map(([row]) => row)];
    if (c.single && c.reaction[0] !== null) { pen.moveTo(X(0), Y(0)); pen.lineTo(X(0), Y(c.reaction[0])); pen.lineTo(X(1), Y(c.reaction[0])); }
    // An unbounded multiplier is null: the line stops before it and starts again after it, as where another motion begins.
    if (!c.single) c.settlement.forEach((s, i) => {
      if (c.reaction[i] === null) return;
      if (i && c.reaction[i - 1] !== null && !leaps.includes(i) && !c.breaks.includes(i)) pen.lineTo(X(s), Y(c.reaction[i])); else pen.moveTo(X(s), Y(c.reaction[i]));
    });
    pen.stroke();
    pen.lineWidth = 1.2; pen.setLineDash([2, 4]);
    for (const i of leaps) { pen.beginPath(); pen.moveTo(X(c.settlement[i - 1]), Y(c.reaction[i - 1])); pen.lineTo(X(c.settlement[i]), Y(c.reaction[i])); pen.stroke(); }
    pen.restore();
    pen.strokeStyle = model.colours.warning; pen.lineWidth = 1;
    const fails = [...c.losses.map(([, at]) => [at, [1, 3]]), ...(c.collapse === null ? [] : [[c.collapse, [5, 4]]])];
    for (const [at, dash] of fails) { pen.setLineDash(dash); pen.beginPath(); pen.moveTo(X(at), top); pen.lineTo(X(at), h - bottom); pen.stroke(); }
    pen.setLineDash([]);
    const at = Math.min(model.frames[k].curve - c.first, c.settlement.length - 1);
    pen.fillStyle = model.frames[k].falling ? model.colours.warning : model.colours.settlement;
    pen.beginPath();
    if (at >= 0 && c.reaction[at] !== null && c.reaction[at] <= yHigh) pen.arc(c.single ? X(model.frames[k].falling ? 0.5 : 0) : X(c.settlement[at]), Y(c.reaction[at]), 5.5, 0, 2 * Math.PI);
    pen.fill();
    state.curveX = c.single ? null : X;
  }

  function show(frame) {
    state.opened = false;
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
    if (state.opened || state.frame >= nFrames - 1) state.frame = 0;
    state.opened = false;
    const k = Math.floor(state.frame);
    state.playing = true; state.shown = -1e9; state.last = performance.now();
    state.clock = model.times[k] + (state.frame - k) * ((model.times[k + 1] || model.times[k]) - model.times[k]);
    $("play").textContent = "❚❚ Pause";
    requestAnimationFrame(step);
  }

  function newtons(value) {
    const size = Math.abs(value), [factor, unit] = size >= 1e6 ? [1e6, "MN"] : size >= 1e3 ? [1e3, "kN"] : [1, "N"];
    return `${+(value / factor).toPrecision(3)} ${unit}`;
  }

  const millimetres = (v) => (1000 * v).toFixed(2).replace(/^-(?=0\.00$)/, "");
  function tell(x, y) {
    const tip = $("tip"), b = state.hover;
    tip.textContent = blockText(b);
    tip.style.display = "block";
    if (x === undefined) return;
    // In the upper corner that is farther away: beside the block it would hide its neighbours.
    tip.style.left = `${x > canvas.clientWidth / 2 ? 6 : Math.max(6, canvas.clientWidth - tip.offsetWidth - 6)}px`;
    tip.style.top = "6px";
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
    tell(...placeOf(state.hover));
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
      dragged(e.offsetX - before[0], e.offsetY - before[1], e);
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
    else if (e.shiftKey && pan) { nudged(...pan); draw(); e.stopPropagation(); }
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
      const at = Math.min(f.curve - model.curve.first, model.curve.settlement.length - 1);
      const d = f.falling || at < 0 ? Infinity : Math.abs(state.curveX(model.curve.settlement[at]) - e.offsetX);
      if (d < nearest) { nearest = d; best = k; }
    });
    stop(); show(best);
  });
  document.addEventListener("keydown", (e) => {
    const at = e.target.tagName;
    // A box to tick needs Space, and a list opens by it.
    const ticked = at === "INPUT" && ["checkbox", "radio"].includes(e.target.type);
    if (e.ctrlKey || e.metaKey || e.altKey || at === "SELECT") return;
    if (e.key === " " && !ticked) { e.preventDefault(); play(); return; }
    if (at === "INPUT" && e.target.type !== "range") return;
    if (at === "INPUT" || e.shiftKey) return;
    const to = { ArrowRight: Math.floor(state.frame) + 1, ArrowLeft: Math.ceil(state.frame) - 1, Home: 0, End: nFrames - 1 }[e.key];
    // Home and End belong to the page, except in the picture.
    if (to === undefined || (e.key.length < 5 && e.target !== canvas)) return;
    e.preventDefault(); stop(); show(to);
  });
  // A button under the focus would be pressed as Space is let go; one pressed by the mouse hands the focus to the picture.
  document.addEventListener("keyup", (e) => { if (e.key === " " && e.target.tagName === "BUTTON") e.preventDefault(); });
  document.addEventListener("click", (e) => { if (e.detail > 0 && e.target.closest("button, label, input[type=checkbox], input[type=radio]") && !e.target.closest("label:has(input[type=number], select)")) canvas.focus({ preventScroll: true }); });
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
    const text = model.frames[k].caption + (falling ? `  ·  ${$("badge").textContent}` : ""), ruler = canvas.getContext("2d");
    // Smaller where the screen is narrow: a number that is cut off reads as another number.
    ruler.font = `16px ${FONT}`;
    const size = Math.min(16, (16 * (w - 28)) / ruler.measureText(text).width);
    pen.fillStyle = LIGHT.ink; pen.font = `${size}px ${FONT}`; pen.textAlign = "left"; pen.textBaseline = "middle";
    pen.fillText(text, 14, HEAD / 2);
  }
  function shifted(work) {
    state.view.y += HEAD;
    try { work(); } finally { state.view.y -= HEAD; }
  }

  $("png").addEventListener("click", () => {
    const target = document.createElement("canvas"), w = canvas.clientWidth, h = canvas.clientHeight + HEAD, pen = target.getContext("2d");
    target.width = 2 * w; target.height = 2 * h;
    pen.scale(2, 2); pen.fillStyle = LIGHT.paper; pen.fillRect(0, 0, w, h);
    shifted(() => paint(pen, w, h, LIGHT, HEAD));
    caption(pen, w);
    target.toBlob((blob) => save(blob, fileName(`_${Math.round(state.frame)}.png`)), "image/png");
  });
  $("svg").addEventListener("click", () => {
    const w = canvas.clientWidth, h = canvas.clientHeight + HEAD, pen = new SvgPen();
    pen.fillStyle = LIGHT.paper; pen.fillRect(0, 0, w, h);
    shifted(() => paint(pen, w, h, LIGHT, HEAD));
    caption(pen, w);
    const text = `<svg xmlns="http://www.w3.org/2000/svg" width="${w}" height="${h}" viewBox="0 0 ${w} ${h}">\n${pen.out.join("\n")}\n</svg>\n`;
    save(new Blob([text], { type: "image/svg+xml" }), fileName(`_${Math.round(state.frame)}.svg`));
  });
  const field = (text) => (/[",\n\r]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  const table = (rows) => new Blob([rows.map((row) => row.map((v) => field(String(v ?? ""))).join(",")).join("\n") + "\n"], { type: "text/csv" });
  $("csv").addEventListener("click", () => {
    const c = model.curve, tied = model.tie_curves ? model.tie_curves.lines : [];
    save(table([[c.x_label || "state", c.y_label, ...tied.map((line) => `${line.name}: ${model.tie_curves.y_label}`)], ...c.settlement.map((s, i) => [s, c.reaction[i], ...tied.map((line) => line.force[i])])]), fileName("_curve.csv"));
  });
  $("joints").addEventListener("click", () => {
    const k = Math.min(Math.round(state.frame), nFrames - 1);
    poseAt(k);
    const rows = [["joint", "opening [mm]", "slip [mm]", "N [N]", "T [N]"]];
    for (let j = 0; j < joints.n; j++) {
      const f = faces(pose, j), force = forceOf(k, j) || ["", ""];
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
    state.opened = !asked.has("frame");
    if (asked.get("play") === "1" && !state.playing) play();
  }
  window.addEventListener("hashchange", wanted);

  $("frame").max = nFrames - 1;
  $("forces").disabled = !model.has_forces;
  $("mechanism").disabled = !model.tints.length;
  $("start").disabled = !model.arrows.length;
  $("svg").disabled = model.space;
  $("tie-curve").hidden = !model.tie_curves;
  const some = model.frames.findIndex((f) => !f.falling);
  $("thrust").disabled = some < 0 || !thrustLine(some).length;
  const c = model.curve, known = c.reaction.filter((v) => v !== null);
  if (known.length) $("curve").setAttribute("aria-label", `Curve: ${c.y_label} against ${c.x_label || "the mechanism"}, from ${known[0]} to ${known[known.length - 1]}, at most ${Math.max(...known)}`);
  $("blocks").setAttribute("aria-label", `The blocks: ${nBlocks}, of which ${model.roles.filter((r) => !r).length} are free`);
  // The page opens on the state that governs, of a path the last equilibrium, and plays from the beginning.
  state.frame = model.opens;
  wanted();
  document.body.dataset.ready = "1";
})();
