"use strict";
// Turns the designs of the report by mouse, touch or keys: parallel projection, WebGL 2.
// The meshes come as base64 in a JSON element: vertices float32 [m], triangles uint32.
(() => {
  const canvas = document.getElementById("viewer");
  if (!canvas) return;
  const scene = JSON.parse(document.getElementById("viewer-data").textContent);
  const designs = scene.designs;
  const gl = canvas.getContext("webgl2", { alpha: false, antialias: true });
  if (!gl) return;  // the pictures of the shapes are all there is
  document.documentElement.classList.add("viewer");

  const compile = (kind, source) => {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) {
      throw new Error(gl.getShaderInfoLog(shader));
    }
    return shader;
  };
  const program = gl.createProgram();
  gl.attachShader(program, compile(gl.VERTEX_SHADER, `#version 300 es
    layout(location = 0) in vec3 point;
    uniform mat3 turn;      // model to view: right, up, towards
    uniform vec3 centre;
    uniform vec2 scale;
    out vec3 seen;
    void main() {
      seen = turn * (point - centre);
      gl_Position = vec4(seen.xy * scale, -0.4 * seen.z, 1.0);
    }`));
  gl.attachShader(program, compile(gl.FRAGMENT_SHADER, `#version 300 es
    precision highp float;
    in vec3 seen;
    uniform vec4 colour;
    out vec4 pixel;
    void main() {
      vec3 normal = normalize(cross(dFdx(seen), dFdy(seen)));
      float light = 0.45 + 0.55 * abs(dot(normal, normalize(vec3(-0.35, 0.45, 0.82))));
      pixel = vec4(colour.rgb * light, colour.a);
    }`));
  gl.linkProgram(program);
  gl.useProgram(program);
  const place = (name) => gl.getUniformLocation(program, name);
  const uniforms = { turn: place("turn"), centre: place("centre"), scale: place("scale"),
    colour: place("colour") };

  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const upload = (part) => {
    const vertices = new Float32Array(bytes(part.vertices).buffer);
    const triangles = new Uint32Array(bytes(part.triangles).buffer);
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, vertices, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, triangles, gl.STATIC_DRAW);
    return { array, count: triangles.length, colour: part.colour };
  };
  const uploaded = designs.map(() => null);
  const partsOf = (i) => (uploaded[i] ??= designs[i].parts.map(upload));

  const start = { azimuth: 0.56, elevation: 0.28, zoom: 1.05 };
  let { azimuth, elevation, zoom } = start;
  let shown = 0, waiting = false;

  const draw = () => {
    waiting = false;
    const ratio = window.devicePixelRatio || 1;
    const width = Math.max(1, Math.round(canvas.clientWidth * ratio));
    const height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width;
      canvas.height = height;
    }
    gl.viewport(0, 0, width, height);
    gl.clearColor(0.973, 0.973, 0.961, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    const ca = Math.cos(azimuth), sa = Math.sin(azimuth);
    const ce = Math.cos(elevation), se = Math.sin(elevation);
    const right = [ca, sa, 0], up = [-sa * se, ca * se, ce], towards = [sa * ce, -ca * ce, se];
    gl.uniformMatrix3fv(uniforms.turn, false,
      [0, 1, 2].flatMap((i) => [right[i], up[i], towards[i]]));
    gl.uniform3fv(uniforms.centre, scene.centre);
    const perMetre = (zoom / scene.radius) * Math.min(width, height);
    gl.uniform2f(uniforms.scale, perMetre / width, perMetre / height);
    for (const part of partsOf(shown)) {  // opaque parts come first
      const translucent = part.colour[3] < 1;
      translucent ? gl.enable(gl.BLEND) : gl.disable(gl.BLEND);
      gl.depthMask(!translucent);
      gl.uniform4fv(uniforms.colour, part.colour);
      gl.bindVertexArray(part.array);
      gl.drawElements(gl.TRIANGLES, part.count, gl.UNSIGNED_INT, 0);
    }
    gl.depthMask(true);
  };
  const redraw = () => {
    if (!waiting) {
      waiting = true;
      requestAnimationFrame(draw);
    }
  };
  const turnBy = (x, y) => {
    azimuth -= x;
    elevation = Math.min(1.57, Math.max(-1.57, elevation + y));
    redraw();
  };
  const zoomBy = (factor) => {
    zoom = Math.min(12, Math.max(0.4, zoom * factor));
    redraw();
  };

  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    if (event.buttons) turnBy(event.movementX * 0.008, event.movementY * 0.008);
  });
  canvas.addEventListener("wheel", (event) => {
    if (document.activeElement !== canvas) return;  // a page that scrolls must go on scrolling
    event.preventDefault();
    zoomBy(Math.exp(-event.deltaY * 0.001));
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1],
      ArrowDown: [0, 0.1] }[event.key];
    if (step) turnBy(...step);
    else if (event.key === "+") zoomBy(1.15);
    else if (event.key === "-") zoomBy(1 / 1.15);
    else return;
    event.preventDefault();
  });
  canvas.addEventListener("dblclick", () => {
    ({ azimuth, elevation, zoom } = start);
    redraw();
  });
  new ResizeObserver(redraw).observe(canvas);

  const buttons = [...document.querySelectorAll("button[data-design]")];
  const show = (i) => {
    shown = i;
    buttons.forEach((b) => b.setAttribute("aria-pressed", String(Number(b.dataset.design) === i)));
    document.getElementById("viewer-label").textContent = designs[i].label;
    redraw();
  };
  buttons.forEach((b) => b.addEventListener("click", () => show(Number(b.dataset.design))));
  show(0);
})();
