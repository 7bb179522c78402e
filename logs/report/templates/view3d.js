"use strict";
// The report's 3-D view: ground, threats, plan and flight in WebGL, labels on a canvas above it.  No library, no network.
(function () {
  var root = document.getElementById("view3d"), holder = document.getElementById("scene-data");
  if (!root || !holder) return;
  var canvas = root.querySelector("canvas.ground"), over = root.querySelector("canvas.labels");
  var gl = canvas.getContext("webgl", { antialias: true, preserveDrawingBuffer: true });
  if (!gl) return; // the still picture stays
  var scene = JSON.parse(holder.textContent), ink = over.getContext("2d");
  var E0 = scene.bounds[0][0], E1 = scene.bounds[0][1], N0 = scene.bounds[1][0], N1 = scene.bounds[1][1];
  var size = Math.max(E1 - E0, N1 - N0, 1), midE = (E0 + E1) / 2, midN = (N0 + N1) / 2;
  var ups = scene.plan.map(function (p) { return p[2]; });
  var low = Math.min.apply(null, ups), high = Math.max.apply(null, ups);
  if (scene.ground) { low = Math.min(low, scene.ground.low); high = Math.max(high, scene.ground.high); }
  var stretches = [1, 1.5, 2, 3, 4, 6], home = null, view = null;

  function reset() {
    var a = scene.plan[0], b = scene.plan[scene.plan.length - 1];
    // Seen across the way from start to destination, from its southern side.
    var across = Math.atan2(b[1] - a[1], b[0] - a[0]) - Math.PI / 2;
    if (Math.sin(across) > 0) across += Math.PI;
    var narrow = Math.min(E1 - E0, N1 - N0) / size, near = 0.9 + 0.44 * Math.min(1, narrow / 0.7);
    view = { az: across, el: 0.62, far: near, e: 0, n: 0, stretch: scene.stretch };
    home = JSON.stringify(view);
  }

  // ---- programs
  function program(vertex, fragment) {
    var p = gl.createProgram();
    [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, "precision mediump float;" + fragment]].forEach(function (part) {
      var s = gl.createShader(part[0]);
      gl.shaderSource(s, part[1]); gl.compileShader(s);
      if (!gl.getShaderParameter(s, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(s));
      gl.attachShader(p, s);
    });
    gl.linkProgram(p);
    if (!gl.getProgramParameter(p, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(p));
    return p;
  }
  var solid = program(
    "attribute vec3 at;attribute vec3 normal;attribute vec3 tint;uniform mat4 m;uniform float stretch;" +
    "varying vec3 vTint;varying vec3 vNormal;" +
    "void main(){gl_Position=m*vec4(at.xy,at.z*stretch,1.);vTint=tint;vNormal=normalize(vec3(normal.xy*stretch,normal.z));}",
    "varying vec3 vTint;varying vec3 vNormal;uniform float alpha;" +
    "void main(){float lit=dot(normalize(vNormal),normalize(vec3(-.5,.5,.8)));" +
    "gl_FragColor=vec4(vTint*clamp(.62+.5*lit,.35,1.08),alpha);}");
  var line = program(
    "attribute vec3 a;attribute vec3 b;attribute vec2 corner;uniform mat4 m;uniform float stretch;uniform vec2 pixel;" +
    "uniform float width;uniform float lift;void main(){vec4 p=m*vec4(a.xy,a.z*stretch,1.);vec4 q=m*vec4(b.xy,b.z*stretch,1.);" +
    "vec2 d=(q.xy/q.w-p.xy/p.w)/pixel;float l=length(d);d=l>0.?d/l:vec2(1.,0.);vec4 o=corner.x<.5?p:q;" +
    "vec2 s=(vec2(-d.y,d.x)*corner.y+d*(corner.x<.5?-.35:.35))*width*pixel;" +
    "gl_Position=vec4(o.xy+s*o.w,o.z-lift*o.w,o.w);}",
    "uniform vec4 colour;void main(){gl_FragColor=colour;}");

  function buffer(data, kind) {
    var b = gl.createBuffer();
    gl.bindBuffer(kind || gl.ARRAY_BUFFER, b);
    gl.bufferData(kind || gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    return b;
  }
  function bind(p, name, b, n, stride, offset) {
    var at = gl.getAttribLocation(p, name);
    if (at < 0) return;
    gl.bindBuffer(gl.ARRAY_BUFFER, b);
    gl.enableVertexAttribArray(at);
    gl.vertexAttribPointer(at, n, gl.FLOAT, false, stride || 0, offset || 0);
  }
  function put(p) { return [(p[0] - midE) / size, (p[1] - midN) / size, (p[2] - low) / size]; }

  // ---- meshes
  var STOPS = [[159, 191, 165], [207, 216, 176], [239, 231, 200], [246, 239, 226], [255, 255, 255]];
  function tint(share) {
    var x = Math.min(Math.max(share, 0), 1) * (STOPS.length - 1), k = Math.min(Math.floor(x), STOPS.length - 2);
    return [0, 1, 2].map(function (c) { return (STOPS[k][c] + (x - k) * (STOPS[k + 1][c] - STOPS[k][c])) / 255; });
  }
  var heights = null;
  function groundMesh() {
    var g = scene.ground, C = g.columns, R = g.rows, raw = atob(g.heights), k, c, r;
    heights = new Float32Array(C * R);
    for (k = 0; k < C * R; k++) {
      var v = raw.charCodeAt(2 * k) + 256 * raw.charCodeAt(2 * k + 1);
      heights[k] = v === 65535 ? NaN : g.low + (v / 65534) * (g.high - g.low);
    }
    var at = new Float32Array(3 * C * R), normal = new Float32Array(3 * C * R), colour = new Float32Array(3 * C * R), index = [];
    var de = (E1 - E0) / (C - 1), dn = (N1 - N0) / (R - 1);
    function h(cc, rr) {
      var v = heights[Math.min(Math.max(rr, 0), R - 1) * C + Math.min(Math.max(cc, 0), C - 1)];
      return v === v ? v : low;
    }
    for (r = 0; r < R; r++) for (c = 0; c < C; c++) {
      k = r * C + c;
      at.set(put([E0 + c * de, N0 + r * dn, h(c, r)]), 3 * k);
      normal.set([-(h(c + 1, r) - h(c - 1, r)) / (2 * de), -(h(c, r + 1) - h(c, r - 1)) / (2 * dn), 1], 3 * k);
      colour.set(tint((h(c, r) - g.low) / Math.max(g.high - g.low, 1)), 3 * k);
      if (r + 1 < R && c + 1 < C && !isNaN(heights[k] + heights[k + 1] + heights[k + C] + heights[k + C + 1]))
        index.push(k, k + 1, k + C + 1, k, k + C + 1, k + C);
    }
    return mesh(at, normal, colour, index);
  }
  function mesh(at, normal, colour, index) {
    return { at: buffer(at), normal: buffer(normal), tint: buffer(colour), count: index.length,
      index: buffer(new Uint16Array(index), gl.ELEMENT_ARRAY_BUFFER) };
  }
  function dome(centre, radius, colour) {
    var at = [], normal = [], colours = [], index = [], U = 36, V = 18, u, v;
    for (v = 0; v <= V; v++) for (u = 0; u <= U; u++) {
      var p = 0.5 * Math.PI * v / V, t = 2 * Math.PI * u / U, n = [Math.sin(p) * Math.cos(t), Math.sin(p) * Math.sin(t), Math.cos(p)];
      at.push.apply(at, put([centre[0] + radius * n[0], centre[1] + radius * n[1], centre[2] + radius * n[2]]));
      normal.push.apply(normal, n); colours.push.apply(colours, colour);
      if (v < V && u < U) { var k = v * (U + 1) + u; index.push(k, k + 1, k + U + 2, k, k + U + 2, k + U + 1); }
    }
    return mesh(new Float32Array(at), new Float32Array(normal), new Float32Array(colours), index);
  }
  function strips(paths, width, colour, ghost) {
    var data = [];
    paths.forEach(function (path) {
      for (var k = 0; k + 1 < path.length; k++) {
        var a = put(path[k]), b = put(path[k + 1]);
        [[0, -1], [1, -1], [1, 1], [0, -1], [1, 1], [0, 1]].forEach(function (corner) {
          data.push(a[0], a[1], a[2], b[0], b[1], b[2], corner[0], corner[1]);
        });
      }
    });
    return { buffer: buffer(new Float32Array(data)), count: data.length / 8, width: width, colour: colour, ghost: ghost };
  }
  function ring(centre, radius, tilt) {
    var out = [];
    // Upper halves of the spheres: a whole circle at the centre's height, half circles above it.
    for (var k = 0; k <= 64; k++) {
      var t = (tilt === 0 ? 2 : 1) * Math.PI * k / 64, c = radius * Math.cos(t), s = radius * Math.sin(t);
      out.push(tilt === 0 ? [centre[0] + c, centre[1] + s, centre[2]] : tilt === 1 ?
        [centre[0] + c, centre[1], centre[2] + s] : [centre[0], centre[1] + c, centre[2] + s]);
    }
    return out;
  }
  function rings(centre, radius) { return [0, 1, 2].map(function (tilt) { return ring(centre, radius, tilt); }); }
  function dashed(paths) {
    var out = [];
    paths.forEach(function (path) { for (var k = 0; k + 1 < path.length; k += 2) out.push([path[k], path[k + 1]]); });
    return out;
  }
  function wall(ring, colour) {
    var at = [], normal = [], colours = [], index = [];
    for (var k = 0; k + 1 < ring.length; k++) {
      var a = ring[k][0], b = ring[k + 1][0], n = [b[1] - a[1], a[0] - b[0], 0], l = Math.hypot(n[0], n[1]) || 1;
      [a, b, ring[k + 1][1], ring[k][1]].forEach(function (p) {
        at.push.apply(at, put(p)); normal.push(n[0] / l, n[1] / l, 0); colours.push.apply(colours, colour);
      });
      index.push(4 * k, 4 * k + 1, 4 * k + 2, 4 * k, 4 * k + 2, 4 * k + 3);
    }
    return mesh(new Float32Array(at), new Float32Array(normal), new Float32Array(colours), index);
  }
  function groundUnder(p) {
    if (!heights) return low;
    var g = scene.ground, c = Math.round((p[0] - E0) / (E1 - E0) * (g.columns - 1)), r = Math.round((p[1] - N0) / (N1 - N0) * (g.rows - 1));
    var v = heights[r * g.columns + c];
    return v === v ? v : low;
  }

  var ground = scene.ground ? groundMesh() : null, domes = [], lines = [];
  var missiles = [], radars = [];
  scene.threats.forEach(function (t) {
    if (t.kill > 0) { domes.push(dome(t.at, t.kill, [0.835, 0.369, 0])); missiles = missiles.concat(rings(t.at, t.kill)); }
    if (t.detection > 0) radars = radars.concat(rings(t.at, t.detection));
  });
  (scene.zones || []).forEach(function (z) {
    z.rings.forEach(function (ring) {
      if (z.keep_out) domes.push(wall(ring, [0.478, 0.122, 0.122]));
      [0, 1].forEach(function (edge) {
        var path = ring.map(function (corner) { return corner[edge]; });
        lines.push(strips([path], z.keep_out ? 1.6 : 2.6, [0.478, 0.122, 0.122, 0.4 + 0.6 * edge], 0.25));
      });
    });
  });
  if (!ground) lines.push(strips([[[E0, N0, low], [E1, N0, low], [E1, N1, low], [E0, N1, low], [E0, N0, low]]], 1.5, [0.5, 0.5, 0.5, 1], 0));
  lines.push(strips(dashed(radars), 1.2, [0, 0.478, 0.353, 0.8], 0.15));
  lines.push(strips(missiles, 1.4, [0.835, 0.369, 0, 1], 0.3));
  lines.push(strips(scene.plan.map(function (p) { return [p, [p[0], p[1], groundUnder(p)]]; }), 1.1, [0.3, 0.3, 0.3, 0.9], 0.2));
  lines.push(strips(scene.failing.legs.map(function (k) { return [scene.plan[k], scene.plan[k + 1]]; }), 11, [0.69, 0.25, 0.541, 0.9], 0.5));
  lines.push(strips([scene.plan], 6, [0.337, 0.706, 0.914, 1], 0.35));
  if (scene.track.length) lines.push(strips([scene.track], 2.2, [0, 0, 0, 1], 0.35));

  // ---- camera
  function multiply(a, b) {
    var out = new Float32Array(16);
    for (var c = 0; c < 4; c++) for (var r = 0; r < 4; r++)
      out[4 * c + r] = a[r] * b[4 * c] + a[4 + r] * b[4 * c + 1] + a[8 + r] * b[4 * c + 2] + a[12 + r] * b[4 * c + 3];
    return out;
  }
  function camera(aspect) {
    var ce = Math.cos(view.el), se = Math.sin(view.el), ca = Math.cos(view.az), sa = Math.sin(view.az);
    var middle = [view.e, view.n, view.stretch * 0.35 * (high - low) / size];
    // forward, right, up of the eye
    var f = [-ca * ce, -sa * ce, -se], r = [-sa, ca, 0], u = [-ca * se, -sa * se, ce];
    var wide = aspect < 1.25 ? 1.25 / aspect : 1, distance = view.far * wide;
    var eye = [middle[0] - f[0] * distance, middle[1] - f[1] * distance, middle[2] - f[2] * distance];
    function dot(a, b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
    var look = [r[0], u[0], -f[0], 0, r[1], u[1], -f[1], 0, r[2], u[2], -f[2], 0, -dot(r, eye), -dot(u, eye), dot(f, eye), 1];
    var t = 1 / Math.tan(0.36), near = distance * 0.02, far = distance + 4;
    var lens = [t / aspect, 0, 0, 0, 0, t, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, 2 * far * near / (near - far), 0];
    return multiply(lens, look);
  }
  function project(m, p, w, h) {
    var a = put(p), z = a[2] * view.stretch;
    var x = m[0] * a[0] + m[4] * a[1] + m[8] * z + m[12], y = m[1] * a[0] + m[5] * a[1] + m[9] * z + m[13];
    var q = m[3] * a[0] + m[7] * a[1] + m[11] * z + m[15];
    return q > 0.001 ? [(x / q + 1) / 2 * w, (1 - y / q) / 2 * h] : null;
  }

  // ---- drawing
  function drawMesh(shape, m, alpha) {
    gl.useProgram(solid);
    gl.uniformMatrix4fv(gl.getUniformLocation(solid, "m"), false, m);
    gl.uniform1f(gl.getUniformLocation(solid, "stretch"), view.stretch);
    gl.uniform1f(gl.getUniformLocation(solid, "alpha"), alpha);
    bind(solid, "at", shape.at, 3); bind(solid, "normal", shape.normal, 3); bind(solid, "tint", shape.tint, 3);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, shape.index);
    gl.drawElements(gl.TRIANGLES, shape.count, gl.UNSIGNED_SHORT, 0);
  }
  function drawLine(item, m, ratio, share) {
    gl.useProgram(line);
    gl.uniformMatrix4fv(gl.getUniformLocation(line, "m"), false, m);
    gl.uniform1f(gl.getUniformLocation(line, "stretch"), view.stretch);
    gl.uniform2f(gl.getUniformLocation(line, "pixel"), 1 / canvas.width, 1 / canvas.height);
    gl.uniform1f(gl.getUniformLocation(line, "width"), item.width * ratio);
    var c = item.colour;
    gl.uniform4f(gl.getUniformLocation(line, "colour"), c[0], c[1], c[2], c[3] * share);
    // Later lines lie on earlier ones: the flight on the plan.
    gl.uniform1f(gl.getUniformLocation(line, "lift"), 0.0005 * (1 + lines.indexOf(item)));
    bind(line, "a", item.buffer, 3, 32, 0); bind(line, "b", item.buffer, 3, 32, 12); bind(line, "corner", item.buffer, 2, 32, 24);
    gl.drawArrays(gl.TRIANGLES, 0, item.count);
  }
  function draw() {
    var ratio = Math.min(window.devicePixelRatio || 1, 2), w = root.clientWidth, h = root.clientHeight;
    if (!w || !h) return;
    [canvas, over].forEach(function (c) { c.width = Math.round(w * ratio); c.height = Math.round(h * ratio); });
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0.93, 0.95, 0.97, 1); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.BLEND); gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.enable(gl.DEPTH_TEST); gl.depthFunc(gl.LEQUAL); gl.depthMask(true);
    var m = camera(w / h);
    if (ground) drawMesh(ground, m, 1);
    // What a ridge hides shines faintly through it.
    gl.depthMask(false); gl.depthFunc(gl.GREATER);
    lines.forEach(function (item) { if (item.ghost) drawLine(item, m, ratio, item.ghost); });
    gl.depthFunc(gl.LEQUAL); gl.depthMask(true);
    lines.forEach(function (item) { drawLine(item, m, ratio, 1); });
    gl.depthMask(false);
    domes.forEach(function (item) { drawMesh(item, m, 0.2); });
    gl.depthMask(true);
    labels(m, w, h, ratio);
    root.dataset.frames = String(1 + Number(root.dataset.frames || 0));
  }
  function labels(m, w, h, ratio) {
    ink.setTransform(ratio, 0, 0, ratio, 0, 0); ink.clearRect(0, 0, w, h);
    var taken = [];
    function write(text, p, colour, bold, dy) {
      var at = project(m, p, w, h);
      if (!at) return;
      ink.font = (bold ? "bold " : "") + "12px system-ui, sans-serif";
      var wide = ink.measureText(text).width, box = [at[0] - wide / 2 - 2, at[1] + dy - 12, at[0] + wide / 2 + 2, at[1] + dy + 3];
      if (taken.some(function (b) { return box[0] < b[2] && b[0] < box[2] && box[1] < b[3] && b[1] < box[3]; })) return;
      taken.push(box);
      ink.textAlign = "center"; ink.lineWidth = 3; ink.strokeStyle = "rgba(255,255,255,.9)"; ink.fillStyle = colour;
      ink.strokeText(text, at[0], at[1] + dy); ink.fillText(text, at[0], at[1] + dy);
    }
    var last = scene.plan.length - 1;
    write("start", scene.plan[0], "#111", true, -10); write("destination", scene.plan[last], "#111", true, -10);
    scene.failing.waypoints.forEach(function (k) { if (scene.plan[k]) write("✗ " + k, scene.plan[k], "#8a2d6b", true, -8); });
    scene.failing.legs.forEach(function (k) {
      var a = scene.plan[k], b = scene.plan[k + 1];
      write("✗ leg " + k, [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2], "#8a2d6b", true, -8);
    });
    scene.plan.forEach(function (p, k) { if (k && k < last) write(String(k), p, "#004c7f", true, -8); });
    scene.threats.forEach(function (t) { write(t.name.slice(0, 24), t.at, "#333", false, 4); });
    (scene.zones || []).forEach(function (z) { write(z.name.slice(0, 24), z.rings[0][0][1], "#7a1f1f", false, -4); });
    write("N", [midE, N1, low], "#111", true, 4); write("S", [midE, N0, low], "#111", true, 4);
    write("E", [E1, midN, low], "#111", true, 4); write("W", [E0, midN, low], "#111", true, 4);
    var words = root.querySelector(".stretch");
    if (words) words.textContent = "heights × " + view.stretch;
  }
  var waiting = false;
  function later() {
    if (waiting) return;
    waiting = true;
    window.requestAnimationFrame(function () { waiting = false; draw(); });
  }

  // ---- hands
  function turn(daz, del) { view.az -= daz; view.el = Math.min(Math.max(view.el + del, 0.03), 1.55); later(); }
  function zoom(by) { view.far = Math.min(Math.max(view.far * by, 0.12), 4); later(); }
  function pan(dx, dy) {
    var k = view.far / root.clientHeight, ca = Math.cos(view.az), sa = Math.sin(view.az);
    view.e = Math.min(Math.max(view.e + k * (sa * dx - ca * dy), -0.6), 0.6);
    view.n = Math.min(Math.max(view.n - k * (ca * dx + sa * dy), -0.6), 0.6);
    later();
  }
  var held = {}, spread = 0, mid = null;
  over.addEventListener("pointerdown", function (event) {
    held[event.pointerId] = [event.clientX, event.clientY]; spread = 0; mid = null;
    over.setPointerCapture(event.pointerId); over.focus({ preventScroll: true });
  });
  over.addEventListener("pointermove", function (event) {
    var before = held[event.pointerId];
    if (!before) return;
    var dx = event.clientX - before[0], dy = event.clientY - before[1];
    held[event.pointerId] = [event.clientX, event.clientY];
    var all = Object.keys(held).map(function (k) { return held[k]; });
    if (all.length >= 2) {
      var now = Math.hypot(all[0][0] - all[1][0], all[0][1] - all[1][1]);
      var centre = [(all[0][0] + all[1][0]) / 2, (all[0][1] + all[1][1]) / 2];
      if (spread && now) zoom(spread / now);
      if (mid) pan(centre[0] - mid[0], centre[1] - mid[1]);
      spread = now; mid = centre;
    } else if (event.shiftKey || (event.buttons & 2)) pan(dx, dy);
    else turn(dx * 0.007, dy * 0.006);
  });
  ["pointerup", "pointercancel"].forEach(function (name) {
    over.addEventListener(name, function (event) { delete held[event.pointerId]; spread = 0; mid = null; });
  });
  over.addEventListener("contextmenu", function (event) { event.preventDefault(); });
  over.addEventListener("wheel", function (event) {
    // The page scrolls as everywhere, until the view was clicked.
    if (document.activeElement !== over && !event.ctrlKey) return;
    event.preventDefault(); zoom(Math.exp(event.deltaY * 0.0012));
  }, { passive: false });
  function back() { view = JSON.parse(home); later(); }
  function stretch() { view.stretch = stretches[(stretches.indexOf(view.stretch) + 1) % stretches.length]; later(); }
  var deeds = {
    left: function () { turn(-0.12, 0); }, right: function () { turn(0.12, 0); },
    up: function () { turn(0, 0.08); }, down: function () { turn(0, -0.08); },
    near: function () { zoom(0.85); }, far: function () { zoom(1 / 0.85); }, home: back, stretch: stretch,
    top: function () { view.az = -Math.PI / 2; view.el = 1.55; later(); },
    side: function () { view.el = 0.12; later(); }
  };
  var keys = { ArrowLeft: "left", ArrowRight: "right", ArrowUp: "up", ArrowDown: "down", "+": "near", "=": "near", "-": "far",
    "0": "home", Home: "home", t: "top", s: "side", h: "stretch" };
  over.addEventListener("keydown", function (event) {
    var deed = keys[event.key];
    if (!deed || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    var panned = { left: [40, 0], right: [-40, 0], up: [0, 40], down: [0, -40] }[deed];
    if (event.shiftKey && panned) pan(panned[0], panned[1]); else deeds[deed]();
  });
  Array.prototype.forEach.call(root.parentNode.querySelectorAll("button[data-do]"), function (button) {
    button.addEventListener("click", function () { deeds[button.dataset.do](); });
  });
  canvas.addEventListener("webglcontextlost", function (event) {
    event.preventDefault(); document.documentElement.classList.remove("live3d");
  });
  window.addEventListener("resize", later);
  reset();
  document.documentElement.classList.add("live3d");
  draw();
})();
