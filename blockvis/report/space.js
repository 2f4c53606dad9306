  const vertices = scaled("vertices", q), offsets = raw.offsets, centroids = scaled("centroids", q);
  const triangles = Uint32Array.from(raw.triangles), edges = Uint32Array.from(raw.edges);
  const travel = scaled("travel", q), turn = scaled("turn", model.turn_unit);
  const joints = { blocks: raw.joint_blocks, n: model.packed.joint_blocks.rows, first: raw.ring_first, points: scaled("ring_points", q), normals: scaled("ring_normals", 1e-6) };
  const forces = { place: scaled("force_place", q), vector: scaled("force_vector", model.force_unit), blocks: raw.force_blocks, first: raw.force_first };
  const marks = { place: scaled("mark_place", q), kind: raw.mark_kind, joint: raw.mark_joint, first: raw.mark_first };
  const jointsOf = Array.from({ length: nBlocks }, () => []);
  for (let j = 0; j < joints.n; j++) { jointsOf[joints.blocks[2 * j]].push(j); jointsOf[joints.blocks[2 * j + 1]].push(j); }

  // Rotations are vectors; turns holds the matrices of those shown, nine numbers a block.
  const corners = new Float32Array(vertices.length), pose = new Float64Array(nBlocks * 6), shown = new Float64Array(nBlocks * 6);
  const turns = { pose: new Float64Array(nBlocks * 9), shown: new Float64Array(nBlocks * 9) };

  function matrix(x, y, z, out, o) {
    const angle = norm(x, y, z), s = angle > 1e-12 ? Math.sin(angle) / angle : 1, c = angle > 1e-6 ? (1 - Math.cos(angle)) / angle ** 2 : 0.5;
    out[o] = 1 - c * (y * y + z * z); out[o + 1] = c * x * y - s * z; out[o + 2] = c * x * z + s * y;
    out[o + 3] = c * x * y + s * z; out[o + 4] = 1 - c * (x * x + z * z); out[o + 5] = c * y * z - s * x;
    out[o + 6] = c * x * z - s * y; out[o + 7] = c * y * z + s * x; out[o + 8] = 1 - c * (x * x + y * y);
  }

  function poseAt(position) {
    const k = Math.min(Math.floor(position), nFrames - 1), t = position - k, next = Math.min(k + 1, nFrames - 1);
    for (let b = 0; b < nBlocks; b++) {
      for (let i = 0; i < 3; i++) {
        const from = 3 * (k * nBlocks + b) + i, to = 3 * (next * nBlocks + b) + i;
        pose[6 * b + i] = travel[from] * (1 - t) + travel[to] * t;
        pose[6 * b + 3 + i] = turn[from] * (1 - t) + turn[to] * t;
      }
    }
    for (let i = 0; i < pose.length; i++) shown[i] = state.magnify * pose[i];
    for (const [at, out] of [[pose, turns.pose], [shown, turns.shown]]) {
      for (let b = 0; b < nBlocks; b++) matrix(at[6 * b + 3], at[6 * b + 4], at[6 * b + 5], out, 9 * b);
    }
    for (let b = 0; b < nBlocks; b++) {
      for (let v = offsets[b]; v < offsets[b + 1]; v++) place(shown, b, vertices[3 * v], vertices[3 * v + 1], vertices[3 * v + 2], corners, 3 * v);
    }
  }

  function place(at, b, x, y, z, out, o) {
    const m = at === pose ? turns.pose : turns.shown, i = 9 * b, dx = x - centroids[3 * b], dy = y - centroids[3 * b + 1], dz = z - centroids[3 * b + 2];
    out[o] = centroids[3 * b] + at[6 * b] + m[i] * dx + m[i + 1] * dy + m[i + 2] * dz;
    out[o + 1] = centroids[3 * b + 1] + at[6 * b + 1] + m[i + 3] * dx + m[i + 4] * dy + m[i + 5] * dz;
    out[o + 2] = centroids[3 * b + 2] + at[6 * b + 2] + m[i + 6] * dx + m[i + 7] * dy + m[i + 8] * dz;
    return out;
  }
  // Where a point of the drawing, riding on a block, is at a pose.
  const carried = (at, b, x, y, z) => place(at, b, x, y, z, [0, 0, 0], 0);
  const dot = (p, r) => p[0] * r[0] + p[1] * r[1] + p[2] * r[2];
  const minus = (p, r) => [p[0] - r[0], p[1] - r[1], p[2] - r[2]];
  const between = (p, r, t) => [p[0] + t * (r[0] - p[0]), p[1] + t * (r[1] - p[1]), p[2] + t * (r[2] - p[2])];

  // The faces of a joint at a pose: corners on both blocks, gaps there, opening, slip, normal from block b into block a.
  function faces(at, j) {
    const a = joints.blocks[2 * j], b = joints.blocks[2 * j + 1], onA = [], onB = [], gaps = [], slips = [];
    const m = at === pose ? turns.pose : turns.shown, n0 = joints.normals.slice(3 * j, 3 * j + 3);
    const turned = (k) => [0, 3, 6].map((r) => m[9 * k + r] * n0[0] + m[9 * k + r + 1] * n0[1] + m[9 * k + r + 2] * n0[2]);
    const ofB = turned(b), sum = turned(a).map((v, r) => v + ofB[r]), both = norm(...sum) || 1, normal = sum.map((v) => v / both);
    for (let i = joints.first[j]; i < joints.first[j + 1]; i++) {
      const p = joints.points.slice(3 * i, 3 * i + 3);
      onA.push(carried(at, a, ...p)); onB.push(carried(at, b, ...p));
      const apart = minus(onA.at(-1), onB.at(-1)), gap = dot(apart, normal);
      gaps.push(gap); slips.push(norm(...apart.map((v, r) => v - gap * normal[r])));
    }
    const bent = norm(...[3, 4, 5].map((i) => at[6 * a + i] - at[6 * b + i]));
    const [opening, slip] = joined(a, b) ? [Math.max(...gaps), Math.max(...slips)] : [0, 0];
    return { a, b, onA, onB, gaps, normal, opening, nearest: Math.min(...gaps), slip, bent };
  }

  // The view: where the eye is, in radians, and where the picture lies on the canvas.
  const eye = { around: model.view[0], above: model.view[1] };
  function axes() {
    const [ca, sa, cb, sb] = [Math.cos(eye.around), Math.sin(eye.around), Math.cos(eye.above), Math.sin(eye.above)];
    return [[-sa, ca, 0], [-sb * ca, -sb * sa, cb], [cb * ca, cb * sa, sb]];
  }
  function fitted(w, h) {
    const [right, up] = axes(), low = model.bounds.slice(0, 3), high = model.bounds.slice(3);
    const box = [Infinity, Infinity, -Infinity, -Infinity];
    for (let i = 0; i < 8; i++) {
      const p = [0, 1, 2].map((c) => ((i >> c) & 1 ? high[c] : low[c])), x = dot(right, p), y = dot(up, p);
      box[0] = Math.min(box[0], x); box[1] = Math.min(box[1], y); box[2] = Math.max(box[2], x); box[3] = Math.max(box[3], y);
    }
    const scale = 0.94 * Math.min(w / (box[2] - box[0]), (h - MARGIN) / (box[3] - box[1]));
    return { scale, x: w / 2 - scale * (box[0] + box[2]) / 2, y: (h - MARGIN) / 2 + scale * (box[1] + box[3]) / 2 };
  }
  function fit() { eye.around = model.view[0]; eye.above = model.view[1]; state.view = fitted(canvas.clientWidth, canvas.clientHeight); }
  const onPage = (p) => { const [right, up] = axes(); return [state.view.x + state.view.scale * dot(right, p), state.view.y - state.view.scale * dot(up, p)]; };

  // Turns about the middle of the structure, which stays where it is on the canvas.
  function turned(dx, dy) {
    const middle = [0, 1, 2].map((c) => (model.bounds[c] + model.bounds[c + 3]) / 2), before = onPage(middle);
    eye.around -= dx; eye.above = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, eye.above + dy));
    const after = onPage(middle);
    state.view.x += before[0] - after[0]; state.view.y += before[1] - after[1];
  }
  function dragged(dx, dy, e) {
    if (e.shiftKey || e.buttons > 1) { state.view.x += dx; state.view.y += dy; } else turned(0.008 * dx, 0.008 * dy);
  }
  const nudged = (dx, dy) => turned(0.004 * dx, 0.004 * dy);
  canvas.addEventListener("contextmenu", (e) => e.preventDefault());

  // What WebGL draws is copied onto the canvas, and words and bars are written over it.
  const glass = document.createElement("canvas"), gl = glass.getContext("webgl2", { antialias: true, alpha: true, preserveDrawingBuffer: true });
  if (!gl) { fail("This page needs WebGL 2 to show blocks in space; the numbers are beside."); }

  function program(vertex, fragment) {
    const made = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, `#version 300 es\nprecision highp float;\n${text}`); gl.compileShader(shader); gl.attachShader(made, shader);
    }
    gl.linkProgram(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS)) fail(`WebGL: ${gl.getProgramInfoLog(made)}`);
    return made;
  }
  const SEE = "uniform vec3 right, up, eye; uniform vec4 place; uniform vec2 size; uniform float deep;\n" +
    "vec3 seen(vec3 p) { return vec3(dot(right, p), dot(up, p), dot(eye, p)); }\n" +
    "vec4 clip(vec3 v) { return vec4((place.x + place.z * v.x) / size.x * 2.0 - 1.0, 1.0 - (place.y - place.z * v.y) / size.y * 2.0, -(v.z - place.w) / deep, 1.0); }\n";
  const solid = gl && program(
    `${SEE} in vec3 at; in vec3 colour; out vec3 v; out vec3 c; void main() { v = seen(at); c = colour; gl_Position = clip(v); }`,
    // Faces go back behind their edges: by what they fall off over a pixel, but not so far that edges behind come forward.
    "in vec3 v; in vec3 c; out vec4 o; uniform float lit, back; void main() { float z = gl_FragCoord.z; gl_FragDepth = z + back * (min(0.6 * fwidth(z), 1e-3) + 2e-6);" +
    "  vec3 k = cross(dFdx(v), dFdy(v)); float l = length(k); vec3 n = l > 1e-12 ? k / l : vec3(0.0, 0.0, 1.0);" +
    " float light = mix(1.0, 0.58 + 0.5 * max(0.0, dot(n, normalize(vec3(-0.45, 0.85, 1.2)))), lit); o = vec4(c * light, 1.0); }");
  const thick = gl && program(
    `${SEE} in vec3 at; in vec3 to; in vec3 colour; in vec2 wide; uniform float ahead; out vec3 c; void main() { vec4 p = clip(seen(at)), r = clip(seen(to));` +
    " vec2 d = (r.xy - p.xy) * size; d = length(d) > 1e-6 ? normalize(d) : vec2(1.0, 0.0); gl_Position = p + vec4(vec2(-d.y, d.x) * wide.x * wide.y / size, -ahead, 0.0); c = colour; }",
    "in vec3 c; out vec4 o; uniform float alpha; void main() { o = vec4(c * alpha, alpha); }");
  const buffers = {};

  function give(name, made, values, width, data = gl.ARRAY_BUFFER) {
    if (!buffers[name]) buffers[name] = gl.createBuffer();
    gl.bindBuffer(data, buffers[name]);
    gl.bufferData(data, values, gl.DYNAMIC_DRAW);
    if (data !== gl.ARRAY_BUFFER) return;
    const at = gl.getAttribLocation(made, name.split(" ").at(-1));
    gl.enableVertexAttribArray(at); gl.vertexAttribPointer(at, width, gl.FLOAT, false, 0, 0);
  }

  // Pixels of a canvas of w × h whose upper left corner is at (left, top) of the picture.
  function look(made, w, h, left = 0, top = 0) {
    gl.useProgram(made);
    const middle = [0, 1, 2].map((c) => (model.bounds[c] + model.bounds[c + 3]) / 2), [right, up, towards] = axes();
    const set = (name, ...values) => gl[`uniform${values.length}f`](gl.getUniformLocation(made, name), ...values);
    set("right", ...right); set("up", ...up); set("eye", ...towards); set("size", w, h);
    set("place", state.view.x - left, state.view.y - top, state.view.scale, dot(towards, middle));
    set("deep", 3 * norm(...minus(model.bounds.slice(3), model.bounds.slice(0, 3))));
    return set;
  }

  const rgb = (text) => (text[0] === "#" ? [1, 3, 5].map((i) => parseInt(text.slice(i, i + 2), 16) / 255) : text.match(/\d+/g).map((v) => v / 255));
  const blockOf = new Uint32Array(vertices.length / 3);
  for (let b = 0; b < nBlocks; b++) blockOf.fill(b, offsets[b], offsets[b + 1]);
  function perVertex(colourOf) {
    const each = Array.from({ length: nBlocks }, (_, b) => colourOf(b)), out = new Float32Array(vertices.length);
    for (let v = 0; v < blockOf.length; v++) out.set(each[blockOf[v]], 3 * v);
    return out;
  }

  function fillOf(b) {
    if (model.roles[b] === 2) return model.colours.moving;
    if (model.roles[b]) return model.colours.support;
    if (isLost(b)) return model.colours.lost;
    if (state.colours === "mechanism" && model.tints.length) return model.tints[b];
    if (state.colours === "displacement") return mixed(Math.max(0, Math.min(1, norm(pose[6 * b], pose[6 * b + 1], pose[6 * b + 2]) / (model.largest_displacement || 1))));
    return model.fills[b];
  }

  // Lines [[x, y, z], [x, y, z], colour, width at the start, width at the end], in pixels; ahead of what lies at their place.
  function drawLines(lines, w, h, ahead, alpha = 1) {
    if (!lines.length) return;
    const set = look(thick, w, h), n = 6 * lines.length;
    const at = new Float32Array(3 * n), to = new Float32Array(3 * n), colour = new Float32Array(3 * n), wide = new Float32Array(2 * n);
    lines.forEach(([p, r, c, w0, w1], i) => [[p, r, 1, w0], [p, r, -1, w0], [r, p, -1, w1], [p, r, -1, w0], [r, p, 1, w1], [r, p, -1, w1]].forEach(([a, b, side, width], k) => {
      at.set(a, 3 * (6 * i + k)); to.set(b, 3 * (6 * i + k)); colour.set(c, 3 * (6 * i + k)); wide.set([side, width], 2 * (6 * i + k));
    }));
    give("l at", thick, at, 3); give("l to", thick, to, 3); give("l colour", thick, colour, 3); give("l wide", thick, wide, 2);
    set("ahead", ahead); set("alpha", alpha);
    gl.drawArrays(gl.TRIANGLES, 0, n);
  }

  function drawPolygons(points, colours, w, h) {
    if (!points.length) return;
    const set = look(solid, w, h);
    set("lit", 0); set("back", 0);
    give("p at", solid, new Float32Array(points.flat()), 3); give("p colour", solid, new Float32Array(colours.flat()), 3);
    gl.drawArrays(gl.TRIANGLES, 0, points.length);
  }

  const CRACKS = model.cracks.map(rgb);
  function crackColour(gap) {
    const at = Math.max(0, Math.min(1, gap / (model.widest_crack || 1))) * (CRACKS.length - 1), k = Math.min(Math.floor(at), CRACKS.length - 2);
    return between(CRACKS[k], CRACKS[k + 1], at - k);
  }

  // Between the edges of the two faces of open joints, where they are open: areas, and lines where these are narrow.
  function drawCracks(w, h) {
    const points = [], colours = [], lines = [], m = state.magnify, least = model.smallest_opening, [widest, steepest] = model.widest;
    for (let j = 0; j < joints.n; j++) {
      const true_ = faces(pose, j);
      if (true_.opening < least) continue;
      const f = m === 1 ? true_ : faces(shown, j), air = true_.bent > steepest || true_.nearest > widest;
      state.cracks++;
      for (let i = 0; i < f.gaps.length; i++) {
        const n = (i + 1) % f.gaps.length, [g, e] = [true_.gaps[i], true_.gaps[n]];
        if (Math.max(g, e) <= least) continue;
        const first = g < least ? (least - g) / (e - g) : 0, last = e < least ? (least - g) / (e - g) : 1;
        const a0 = between(f.onA[i], f.onA[n], first), a1 = between(f.onA[i], f.onA[n], last), b0 = between(f.onB[i], f.onB[n], first), b1 = between(f.onB[i], f.onB[n], last);
        const c0 = crackColour(g + first * (e - g)), c1 = crackColour(g + last * (e - g));
        if (air) { lines.push([a0, a1, c0, 1.6, 1.6], [b0, b1, c0, 1.6, 1.6]); continue; }
        points.push(a0, a1, b1, a0, b1, b0); colours.push(c0, c1, c1, c0, c1, c0);
        lines.push([between(a0, b0, 0.5), between(a1, b1, 0.5), between(c0, c1, 0.5), 1.7, 1.7]);
      }
    }
    drawPolygons(points, colours, w, h);
    drawLines(lines, w, h, 2e-4);
  }

  function drawSolid(w, h, colours, near, falling) {
    gl.enable(gl.DEPTH_TEST);
    const set = look(solid, w, h);
    set("lit", 1); set("back", 1);
    give("s at", solid, corners, 3); give("s colour", solid, perVertex((b) => rgb(fillOf(b))), 3);
    give("s faces", solid, triangles, 0, gl.ELEMENT_ARRAY_BUFFER);
    gl.drawElements(gl.TRIANGLES, triangles.length, gl.UNSIGNED_INT, 0);
    set("lit", 0); set("back", 0);
    give("s colour", solid, perVertex(() => rgb(model.colours.outline)), 3);
    give("s edges", solid, edges, 0, gl.ELEMENT_ARRAY_BUFFER);
    gl.drawElements(gl.LINES, edges.length, gl.UNSIGNED_INT, 0);
    if (layers.start) drawStart(w, h, colours);
    if (layers.cracks && (!falling || model.joints_of_fall)) drawCracks(w, h);
    if (state.hover >= 0) {
      const rim = [], c = rgb(model.colours.settlement), point = (v) => corners.slice(3 * v, 3 * v + 3);
      for (let i = 0; i < edges.length; i += 2) if (blockOf[edges[i]] === state.hover) rim.push([point(edges[i]), point(edges[i + 1]), c, 3, 3]);
      drawLines(rim, w, h, 3e-4);
    }
    if (layers.start && !falling) drawArrows(near, w, h);
    if (model.fill && !falling && state.magnify === 1) drawLines(model.fill.edges[near].map((e) => [e.slice(0, 3), e.slice(3), rgb(model.fill.colours[2]), 1.6, 1.6]), w, h, 0);
    if (state.magnify !== 1 || Math.abs(state.frame - near) >= 0.5) return;
    if (layers.sliding) drawLines(slidingEdges(near), w, h, 3e-4);
    if (layers.hinges) {
      const lines = [];
      for (let i = marks.first[near]; i < marks.first[near + 1]; i++) if (marks.kind[i] === 1) lines.push([marks.place.slice(6 * i, 6 * i + 3), marks.place.slice(6 * i + 3, 6 * i + 6), rgb(model.colours.hinge), 4, 4]);
      drawLines(lines, w, h, 4e-4);
      gl.disable(gl.DEPTH_TEST); gl.enable(gl.BLEND); gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
      drawLines(lines.map(([p, r, c]) => [p, r, c, 2, 2]), w, h, 0, 0.25);
      gl.disable(gl.BLEND); gl.enable(gl.DEPTH_TEST);
    }
  }

  // Where the moving supports were.
  function drawStart(w, h, colours) {
    const lines = [], c = rgb(colours.ghost), point = (v) => vertices.slice(3 * v, 3 * v + 3);
    for (let i = 0; i < edges.length; i += 2) if (model.roles[blockOf[edges[i]]] === 2) lines.push([point(edges[i]), point(edges[i + 1]), c, 1, 1]);
    drawLines(lines, w, h, 0);
  }

  function drawArrows(k, w, h) {
    const lines = [], c = rgb(model.colours.settlement), long = 46 / state.view.scale;
    for (const [b, x, y, z, ...direction] of model.arrows[model.frames[k].phase] || []) {
      const start = carried(shown, b, x, y, z), neck = start.map((v, i) => v + 0.6 * long * direction[i]), tip = start.map((v, i) => v + long * direction[i]);
      lines.push([start, neck, c, 5, 5], [neck, tip, c, 16, 0]);
    }
    drawLines(lines, w, h, 1e-4);
  }

  function slidingEdges(k) {
    const lines = [], c = rgb(model.colours.sliding);
    for (let i = marks.first[k]; i < marks.first[k + 1]; i++) {
      if (marks.kind[i] !== 2 || marks.joint[i] < 0) continue;
      const f = faces(pose, marks.joint[i]), middle = f.onA.map((p, n) => between(p, f.onB[n], 0.5));
      middle.forEach((p, n) => lines.push([p, middle[(n + 1) % middle.length], c, 3, 3]));
    }
    return lines;
  }

  // Everything in the picture, below a head of so many pixels.
  function paint(pen, w, h, colours, head = 0) {
    const near = Math.min(Math.round(state.frame), nFrames - 1), falling = model.frames[near].falling, sharpness = Math.abs(pen.getTransform().a);
    state.cracks = 0;
    if (gl) {
      glass.width = Math.round(w * sharpness); glass.height = Math.round(h * sharpness);
      gl.viewport(0, 0, glass.width, glass.height);
      gl.clearColor(0, 0, 0, 0); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      drawSolid(w, h, colours, near, falling);
      pen.drawImage(glass, 0, 0, w, h);
    }
    if (state.magnify === 1 && Math.abs(state.frame - near) < 0.5) {
      if (!falling) drawForces(pen, near);
      drawLoads(pen, near, onPage);
      for (let i = marks.first[near]; i < marks.first[near + 1]; i++) if (marks.kind[i] === 3) spot(pen, ...onPage(marks.place.slice(6 * i, 6 * i + 3)), 5, model.colours.crushing, model.colours.hinge);
    }
    drawTies(pen, near, colours, onPage);
    axesOfDrawing(pen, w, head, colours);
    scaleBar(pen, w, h, colours);
  }

  // Forces lie inside the blocks: they are drawn over them.
  function drawForces(pen, k) {
    const bar = (p, r) => { const [x0, y0] = onPage(p), [x1, y1] = onPage(r); pen.beginPath(); pen.moveTo(x0, y0); pen.lineTo(x1, y1); pen.stroke(); };
    pen.strokeStyle = model.colours.force; pen.lineCap = "round";
    if (layers.forces) {
      pen.lineWidth = 2;
      for (let i = forces.first[k]; i < forces.first[k + 1]; i++) {
        const p = forces.place.slice(3 * i, 3 * i + 3), half = [0, 1, 2].map((c) => forces.vector[3 * i + c] * model.force_length / 2);
        bar(minus(p, half), [p[0] + half[0], p[1] + half[1], p[2] + half[2]]);
      }
    }
    if (layers.thrust) { pen.lineWidth = 3; for (const [p, r] of thrustLine(k)) bar(p, r); }
  }

  // From joint to joint, where every free block has two at most: an arch, a column.
  function thrustLine(k) {
    const met = Array.from({ length: nBlocks }, () => []), at = (i) => [...forces.place.slice(3 * i, 3 * i + 3)];
    for (let i = forces.first[k]; i < forces.first[k + 1]; i++) for (const b of [forces.blocks[2 * i], forces.blocks[2 * i + 1]]) if (!model.roles[b]) met[b].push(i);
    if (met.some((of) => of.length > 2)) return [];
    return met.filter((of) => of.length === 2).map(([i, j]) => [at(i), at(j)]);
  }

  // The axes of the drawing, in the upper right corner.
  function axesOfDrawing(pen, w, head, colours) {
    const [right, up] = axes(), x0 = w - 44, y0 = head + 46;
    pen.strokeStyle = pen.fillStyle = colours.ghost; pen.lineWidth = 1.5; pen.font = `13px ${FONT}`; pen.textAlign = "center"; pen.textBaseline = "middle";
    ["x", "y", "z"].forEach((name, c) => {
      const dx = right[c], dy = -up[c];
      pen.beginPath(); pen.moveTo(x0, y0); pen.lineTo(x0 + 22 * dx, y0 + 22 * dy); pen.stroke();
      pen.fillText(name, x0 + 31 * dx, y0 + 31 * dy);
    });
  }

  // The block at a place of the canvas: what is drawn there on a canvas of one pixel, coloured by number.
  let target = null;
  function blockAt(x, y) {
    if (!gl) return -1;
    if (!target) {
      target = gl.createFramebuffer(); gl.bindFramebuffer(gl.FRAMEBUFFER, target);
      for (const [what, kind] of [[gl.COLOR_ATTACHMENT0, gl.RGBA8], [gl.DEPTH_ATTACHMENT, gl.DEPTH_COMPONENT16]]) {
        const store = gl.createRenderbuffer();
        gl.bindRenderbuffer(gl.RENDERBUFFER, store); gl.renderbufferStorage(gl.RENDERBUFFER, kind, 1, 1); gl.framebufferRenderbuffer(gl.FRAMEBUFFER, what, gl.RENDERBUFFER, store);
      }
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, target);
    gl.viewport(0, 0, 1, 1); gl.enable(gl.DEPTH_TEST); gl.clearColor(0, 0, 0, 0); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const set = look(solid, 1, 1, x, y);
    set("lit", 0); set("back", 0);
    give("s at", solid, corners, 3); give("s colour", solid, perVertex((b) => [0, 8, 16].map((bits) => (((b + 1) >> bits) & 255) / 255)), 3);
    give("s faces", solid, triangles, 0, gl.ELEMENT_ARRAY_BUFFER);
    gl.drawElements(gl.TRIANGLES, triangles.length, gl.UNSIGNED_INT, 0);
    const pixel = new Uint8Array(4);
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return (pixel[0] | (pixel[1] << 8) | (pixel[2] << 16)) - 1;
  }

  // The joint of a block whose edge is nearest to a place, if it is within reach of a finger.
  function jointAt(b, x, y) {
    let best = -1, least = 10;
    for (const j of jointsOf[b] || []) {
      const f = faces(shown, j), ring = f.onA.map((p, n) => onPage(between(p, f.onB[n], 0.5)));
      ring.forEach(([x0, y0], n) => {
        const [x1, y1] = ring[(n + 1) % ring.length], dx = x1 - x0, dy = y1 - y0;
        const t = Math.max(0, Math.min(1, ((x - x0) * dx + (y - y0) * dy) / (dx * dx + dy * dy || 1))), away = norm(x - x0 - t * dx, y - y0 - t * dy);
        if (away < least) { least = away; best = j; }
      });
    }
    return best;
  }

  function jointText(j, b) {
    const f = faces(pose, j), force = forceOf(Math.min(Math.round(state.frame), nFrames - 1), j);
    const carries = force === null ? "no equilibrium" : `N ${newtons(force[0])}, T ${newtons(force[1])}`;
    return `joint with ${model.names[f.a === b ? f.b : f.a]}: opening ${millimetres(Math.max(0, f.opening))} mm, slip ${millimetres(f.slip)} mm, ${carries}`;
  }

  const MOST_JOINTS = 6;
  function blockText(b) {
    const p = [...pose.slice(6 * b, 6 * b + 6)], kind = isLost(b) ? "lost" : ["free", "fixed support", "moving support"][model.roles[b]];
    const own = jointsOf[b].map((j) => [j === state.joint ? Infinity : faces(pose, j).opening, j]).sort((one, two) => two[0] - one[0]).map(([, j]) => j);
    const more = own.length > MOST_JOINTS ? `\nand ${own.length - MOST_JOINTS} more joints` : "";
    return `${model.names[b]}${model.materials[b] ? " · " + model.materials[b] : ""} · ${kind}\n` +
      `displacement ${millimetres(norm(...p.slice(0, 3)))} mm (${p.slice(0, 3).map(millimetres).join(", ")})\n` +
      `rotation ${(1000 * norm(...p.slice(3))).toFixed(2)} mrad` + own.slice(0, MOST_JOINTS).map((j) => `\n${jointText(j, b)}`).join("") + more;
  }

  const placeOf = (b) => onPage(carried(shown, b, centroids[3 * b], centroids[3 * b + 1], centroids[3 * b + 2]));
