// The 3-D view's drawing in WebGL: two programs, one for lit surfaces, one for lines of a width in pixels.

function makePainter(canvas) {
  const gl = canvas.getContext("webgl", { alpha: false, antialias: true, preserveDrawingBuffer: true });
  if (!gl) return null;

  function program(vertex, fragment) {
    const made = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, "precision mediump float;" + fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(made, shader);
    }
    gl.linkProgram(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
    return made;
  }
  const solid = program(`
    attribute vec3 at; attribute vec3 normal; attribute vec3 tint;
    uniform mat4 m; uniform float stretch;
    varying vec3 vTint; varying vec3 vNormal;
    void main() {
      gl_Position = m * vec4(at.xy, at.z * stretch, 1.);
      vTint = tint;
      vNormal = normalize(vec3(normal.xy * stretch, normal.z));
    }`, `
    varying vec3 vTint; varying vec3 vNormal; uniform float alpha;
    void main() {
      float lit = dot(normalize(vNormal), normalize(vec3(-.5, .5, .8)));
      gl_FragColor = vec4(vTint * clamp(.62 + .5 * lit, .35, 1.08), alpha);
    }`);
  // Each piece of a line is two triangles about it, as broad as asked whatever its distance.
  const line = program(`
    attribute vec3 a; attribute vec3 b; attribute vec2 corner;
    uniform mat4 m; uniform float stretch; uniform vec2 pixel; uniform float width; uniform float lift;
    void main() {
      vec4 p = m * vec4(a.xy, a.z * stretch, 1.);
      vec4 q = m * vec4(b.xy, b.z * stretch, 1.);
      vec2 d = (q.xy / q.w - p.xy / p.w) / pixel;
      float l = length(d);
      d = l > 0. ? d / l : vec2(1., 0.);
      vec4 o = corner.x < .5 ? p : q;
      vec2 s = (vec2(-d.y, d.x) * corner.y + d * (corner.x < .5 ? -.35 : .35)) * width * pixel;
      gl_Position = vec4(o.xy + s * o.w, o.z - lift * o.w, o.w);
    }`, "uniform vec4 colour; void main() { gl_FragColor = colour; }");

  function buffer(data, kind) {
    const made = gl.createBuffer();
    gl.bindBuffer(kind || gl.ARRAY_BUFFER, made);
    gl.bufferData(kind || gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    return made;
  }
  function bind(of, name, held, size, stride, offset) {
    const at = gl.getAttribLocation(of, name);
    if (at < 0) return;
    gl.bindBuffer(gl.ARRAY_BUFFER, held);
    gl.enableVertexAttribArray(at);
    gl.vertexAttribPointer(at, size, gl.FLOAT, false, stride || 0, offset || 0);
  }
  // shape: arrays `at`, `normal`, `tint` of three numbers a corner, and `index`, three corners a triangle.
  function upload(shape) {
    return {
      at: buffer(new Float32Array(shape.at)), normal: buffer(new Float32Array(shape.normal)),
      tint: buffer(new Float32Array(shape.tint)), count: shape.index.length,
      index: buffer(new Uint16Array(shape.index), gl.ELEMENT_ARRAY_BUFFER),
    };
  }
  // pieces: eight numbers a corner, as `linePieces` makes them.
  function uploadLine(pieces) { return { buffer: buffer(new Float32Array(pieces)), count: pieces.length / 8 }; }
  function free(held) {
    for (const name of ["at", "normal", "tint", "index", "buffer"]) if (held[name]) gl.deleteBuffer(held[name]);
  }
  function drawMesh(held, m, stretch, alpha) {
    gl.useProgram(solid);
    gl.uniformMatrix4fv(gl.getUniformLocation(solid, "m"), false, m);
    gl.uniform1f(gl.getUniformLocation(solid, "stretch"), stretch);
    gl.uniform1f(gl.getUniformLocation(solid, "alpha"), alpha);
    for (const name of ["at", "normal", "tint"]) bind(solid, name, held[name], 3);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, held.index);
    gl.drawElements(gl.TRIANGLES, held.count, gl.UNSIGNED_SHORT, 0);
  }
  // lift: how far the line stands before what it lies on, so that later lines lie on earlier ones.
  function drawLine(held, m, stretch, width, [red, green, blue, alpha], lift) {
    gl.useProgram(line);
    gl.uniformMatrix4fv(gl.getUniformLocation(line, "m"), false, m);
    gl.uniform1f(gl.getUniformLocation(line, "stretch"), stretch);
    gl.uniform2f(gl.getUniformLocation(line, "pixel"), 1 / canvas.width, 1 / canvas.height);
    gl.uniform1f(gl.getUniformLocation(line, "width"), width);
    gl.uniform4f(gl.getUniformLocation(line, "colour"), red, green, blue, alpha);
    gl.uniform1f(gl.getUniformLocation(line, "lift"), lift);
    bind(line, "a", held.buffer, 3, 32, 0);
    bind(line, "b", held.buffer, 3, 32, 12);
    bind(line, "corner", held.buffer, 2, 32, 24);
    gl.drawArrays(gl.TRIANGLES, 0, held.count);
  }
  function clear([red, green, blue]) {
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.depthMask(true);
    gl.clearColor(red, green, blue, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
  }
  return {
    upload, uploadLine, free, drawMesh, drawLine, clear,
    // What lies behind other things alone: a ridge's other side.
    behind: () => { gl.depthMask(false); gl.depthFunc(gl.GREATER); },
    before: () => { gl.depthMask(true); gl.depthFunc(gl.LEQUAL); },
    // See-through things hide nothing.
    through: () => gl.depthMask(false),
    onTop: () => { gl.depthMask(true); gl.clear(gl.DEPTH_BUFFER_BIT); },
  };
}
