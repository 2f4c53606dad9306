  const vertices = scaled("vertices", q), offsets = raw.offsets, centroids = scaled("centroids", q);
  const travel = scaled("travel", q), turn = scaled("turn", model.turn_unit);
  const joints = { blocks: raw.joint_blocks, ends: scaled("joint_ends", q), n: model.packed.joint_blocks.rows };
  const forces = { place: scaled("force_place", q), vector: scaled("force_vector", model.force_unit), blocks: raw.force_blocks, first: raw.force_first };
  const marks = { place: scaled("mark_place", q), kind: raw.mark_kind, first: raw.mark_first };
  const jointsOf = Array.from({ length: nBlocks }, () => []);
  for (let j = 0; j < joints.n; j++) { jointsOf[joints.blocks[2 * j]].push(j); jointsOf[joints.blocks[2 * j + 1]].push(j); }
  const corners = new Float64Array(vertices.length), pose = new Float64Array(nBlocks * 3), shown = new Float64Array(nBlocks * 3);
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

  // The faces of a joint at a pose: ends on both blocks, opening, slip, normal from block b into block a.
  function faces(at, j) {
    const a = joints.blocks[2 * j], b = joints.blocks[2 * j + 1], e = joints.ends;
    const ends = [[e[4 * j], e[4 * j + 1]], [e[4 * j + 2], e[4 * j + 3]]];
    const [a0, a1] = ends.map((p) => carried(at, a, ...p)), [b0, b1] = ends.map((p) => carried(at, b, ...p));
    const length = norm(ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]);
    // Half-way between the faces, out of that of block b: they run from the first end to the second.
    const x = b1[0] - b0[0] + a1[0] - a0[0], y = b1[1] - b0[1] + a1[1] - a0[1], both = norm(x, y) || 1, nx = y / both, ny = -x / both;
    const across = [[a0, b0], [a1, b1]].map(([p, r]) => (p[0] - r[0]) * nx + (p[1] - r[1]) * ny);
    // Both ends slip alike.
    const [opening, slip] = joined(a, b) ? [Math.max(...across), (a0[1] - b0[1]) * nx - (a0[0] - b0[0]) * ny] : [0, 0];
    return { a, b, a0, a1, b0, b1, length, nx, ny, opening, slip, nearest: Math.min(...across), bent: Math.abs(at[3 * a + 2] - at[3 * b + 2]) };
  }

  function fitted(w, h) {
    const [x0, y0, x1, y1] = model.bounds, scale = Math.min(w / (x1 - x0), (h - MARGIN) / (y1 - y0));
    return { scale, x: w / 2 - scale * (x0 + x1) / 2, y: (h - MARGIN) / 2 + scale * (y0 + y1) / 2 };
  }
  function fit() { state.view = fitted(canvas.clientWidth, canvas.clientHeight); }
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

  // Lines across a tile, which rise to the right or fall, on paper or on nothing.
  function tiled(size, paper, line, rises) {
    const tile = document.createElement("canvas"), pen = tile.getContext("2d");
    tile.width = tile.height = size;
    if (paper) { pen.fillStyle = paper; pen.fillRect(0, 0, size, size); }
    pen.strokeStyle = line; pen.lineWidth = 0.9;
    pen.beginPath();
    for (const x of [-size, 0, size]) { pen.moveTo(x - 1, rises ? size + 1 : -1); pen.lineTo(x + size + 1, rises ? -1 : size + 1); }
    pen.stroke();
    return canvas.getContext("2d").createPattern(tile, "repeat");
  }
  const support = tiled(9, model.colours.support, model.colours.hatch, true), earth = tiled(9, null, model.colours.hatch, true);

  // The ground of a fall, and what lies between it and supports that are ground, as they reach below all free blocks.
  const lowest = new Float64Array(nBlocks).fill(Infinity);
  for (let b = 0; b < nBlocks; b++) for (let v = offsets[b]; v < offsets[b + 1]; v++) lowest[b] = Math.min(lowest[b], vertices[2 * v + 1]);
  const lowestFree = lowest.reduce((least, y, b) => (model.roles[b] ? least : Math.min(least, y)), Infinity);
  function drawGround(pen, w) {
    const y = model.ground, sides = [[world(0, 0)[0], y, world(w, 0)[0], y]];
    pen.fillStyle = earth;
    for (let b = 0; b < nBlocks; b++) {
      if (!model.roles[b] || lowest[b] >= lowestFree) continue;
      for (let v = offsets[b], n = offsets[b + 1]; v < n; v++) {
        const next = v + 1 < n ? v + 1 : offsets[b], [x0, y0, x1, y1] = [corners[2 * v], corners[2 * v + 1], corners[2 * next], corners[2 * next + 1]];
        if (x1 <= x0 || y0 <= y) continue;
        if (!(pen instanceof SvgPen)) { ring(pen, [[x0, y0], [x1, y1], [x1, y], [x0, y]]); pen.fill(); }
        sides.push([x0, y0, x0, y], [x1, y1, x1, y]);
      }
    }
    pen.strokeStyle = model.colours.hatch; pen.lineWidth = 1.5; lineBetween(pen, sides);
  }

  // Fill lies on pieces of blocks, up to its surface, wherever they are.
  const hatched = model.fill && tiled(14, ...model.fill.colours.slice(0, 2), false);
  function fillPieces(k) {
    return model.fill.pieces.filter(([b]) => !gone[k].has(b)).map(([b, x0, y0, x1, y1, surface, base, weight, across]) => {
      const p = carried(shown, b, x0, y0), r = carried(shown, b, x1, y1), depth = Math.max(0, surface - Math.max(base, (p[1] + r[1]) / 2));
      // Along the outward normal, which is upwards.
      const up = p[0] - r[0], load = up > 0 ? weight * depth : 0;
      return { p, r, surface, fx: load * across * (p[1] - r[1]), fy: -load * up };
    });
  }
  function drawFill(pen, k) {
    const [paper, , rim] = model.fill.colours, pieces = fillPieces(k);
    pen.fillStyle = pen instanceof SvgPen ? paper : hatched;
    // Over a joint that gapes the fill is one body; pieces run from the right to the left.
    const sorted = [...pieces].sort((one, other) => one.r[0] - other.r[0]);
    sorted.slice(1).forEach((right, i) => {
      const left = sorted[i], wide = right.r[0] - left.p[0];
      if (wide > 0 && wide < model.fill.gaping && left.surface === right.surface) pieces.push({ p: right.r, r: left.p, surface: left.surface });
    });
    for (const { p, r, surface } of pieces) { ring(pen, [p, r, [r[0], surface], [p[0], surface]]); pen.fill(); }
    pen.strokeStyle = rim; pen.lineWidth = 1.5;
    lineBetween(pen, pieces.map(({ p, r, surface }) => [p[0], surface, r[0], surface]));
  }
  function drawFillLoad(pen, k) {
    for (const { p, r, fx, fy } of fillPieces(k)) {
      const x = (p[0] + r[0]) / 2, y = (p[1] + r[1]) / 2, s = model.fill.scale;
      arrow(pen, px(x - s * fx), py(y - s * fy), px(x), py(y), model.fill.colours[2], 2);
    }
  }

  function fillOf(b, vector) {
    if (model.roles[b]) return vector ? model.colours.support : support;
    if (isLost(b)) return model.colours.lost;
    if (state.colours === "mechanism" && model.tints.length) return model.tints[b];
    if (state.colours === "displacement") {
      const part = norm(pose[3 * b], pose[3 * b + 1]) / (model.largest_displacement || 1);
      return mixed(Math.max(0, Math.min(1, part)));
    }
    return model.fills[b];
  }
  // Fills the open joints; returns the middle lines of those too narrow to be seen as areas.
  function drawCracks(pen) {
    const lines = [], [widest, steepest] = model.widest;
    pen.fillStyle = model.colours.open;
    for (let j = 0; j < joints.n; j++) {
      const f = faces(shown, j), m = state.magnify;
      // Blocks that have parted have no joint any more: what lies between them is air.
      if (f.opening < model.smallest_opening * m || f.nearest > m * Math.min(f.length, widest)) continue;
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
    if (model.ground !== null) drawGround(pen, w);
    if (model.fill && !falling) drawFill(pen, near);
    if (layers.start) drawStart(pen, colours);
    state.cracks = 0;
    const lines = layers.cracks && (!falling || model.joints_of_fall) ? drawCracks(pen) : [];
    const thin = Math.max(0.4, Math.min(1.1, model.block_size * state.view.scale / 25));
    for (let b = 0; b < nBlocks; b++) {
      outline(pen, corners, b);
      [pen.strokeStyle, pen.lineWidth] = isLost(b) ? [model.colours.warning, 2 * thin] : [model.colours.outline, thin];
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
      if (layers.forces && model.fill && !falling) drawFillLoad(pen, near);
      if (layers.hinges) drawDots(pen, near, 1, model.colours.hinge, "#fff");
      drawDots(pen, near, 3, model.colours.crushing, model.colours.hinge);
      drawLoads(pen, near, ([x, y]) => [px(x), py(y)]);
    }
    drawTies(pen, near, colours, ([x, y]) => [px(x), py(y)]);
    scaleBar(pen, w, h, colours);
  }

  function drawStart(pen, colours) {
    pen.strokeStyle = colours.ghost; pen.lineWidth = 1.2; pen.setLineDash([5, 4]);
    for (let b = 0; b < nBlocks; b++) if (model.roles[b] === 2) { outline(pen, vertices, b); pen.stroke(); }
    pen.setLineDash([]);
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

  function drawDots(pen, k, kind, fill, rim) {
    const radius = Math.max(2.2, Math.min(6.5, 0.09 * model.block_size * state.view.scale));
    for (let i = marks.first[k]; i < marks.first[k + 1]; i++) {
      if (marks.kind[i] !== kind) continue;
      spot(pen, px(marks.place[4 * i]), py(marks.place[4 * i + 1]), radius, fill, rim);
    }
  }

  function drawSliding(pen, k) {
    const ends = [];
    for (let i = marks.first[k]; i < marks.first[k + 1]; i++) if (marks.kind[i] === 2) ends.push([...marks.place.slice(4 * i, 4 * i + 4)]);
    pen.strokeStyle = model.colours.sliding; pen.lineWidth = 3.5; pen.lineCap = "round"; lineBetween(pen, ends);
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
  function jointText(j, b) {
    const f = faces(pose, j), other = f.a === b ? f.b : f.a;
    const force = forceOf(Math.min(Math.round(state.frame), nFrames - 1), j);
    const carries = force === null ? "no equilibrium" : `N ${newtons(force[0])}, T ${newtons(force[1])}`;
    return `joint with ${model.names[other]}: opening ${millimetres(Math.max(0, f.opening))} mm, slip ${millimetres(Math.abs(f.slip))} mm, ${carries}`;
  }

  const MOST_JOINTS = 6;
  function blockText(b) {
    const size = norm(pose[3 * b], pose[3 * b + 1]);
    const kind = isLost(b) ? "lost" : ["free", "fixed support", "moving support"][model.roles[b]];
    const own = jointsOf[b].map((j) => [j === state.joint ? Infinity : faces(pose, j).opening, j]).sort((one, two) => two[0] - one[0]).map(([, j]) => j);
    const more = own.length > MOST_JOINTS ? `\nand ${own.length - MOST_JOINTS} more joints` : "";
    return `${model.names[b]}${model.materials[b] ? " · " + model.materials[b] : ""} · ${kind}\n` +
      `displacement ${millimetres(size)} mm (${millimetres(pose[3 * b])}, ${millimetres(pose[3 * b + 1])})\nrotation ${(1000 * pose[3 * b + 2]).toFixed(2)} mrad` +
      own.slice(0, MOST_JOINTS).map((j) => `\n${jointText(j, b)}`).join("") + more;
  }

  const placeOf = (b) => { const [x, y] = carried(shown, b, centroids[2 * b], centroids[2 * b + 1]); return [px(x), py(y)]; };
  function dragged(dx, dy) { state.view.x += dx; state.view.y += dy; }
  const nudged = dragged;
