// A small player of motions on a 2-D canvas: scrubber, speed, several figures side by side, a camera that one drags.
// Data arrive as JSON beside the canvases: positions are int16, base64, in steps of `step` metres from `origin`.
(function () {
  "use strict";
  const COLORS = [[232, 116, 88], [122, 131, 150], [62, 140, 200]];
  const FOCAL = 1.6;

  function decode(motion) {
    const bytes = Uint8Array.from(atob(motion.data), (c) => c.charCodeAt(0));
    const view = new DataView(bytes.buffer);
    const values = new Float32Array(bytes.length / 2);
    for (let i = 0; i < values.length; i++)
      values[i] = view.getInt16(2 * i, true) * motion.step + motion.origin[i % 3];
    motion.values = values;
    motion.stride = motion.joints * 3;
    motion.duration = (motion.frames - 1) / motion.fps;
    motion.focus = follow(motion);
  }

  // The root's way over the floor, smoothed, for the camera to follow.
  function follow(motion) {
    const reach = Math.max(1, Math.round(motion.fps * 0.4)), focus = new Float32Array(motion.frames * 2);
    for (let axis = 0; axis < 2; axis++)
      for (let f = 0; f < motion.frames; f++) {
        let sum = 0, weight = 0;
        for (let k = -3 * reach; k <= 3 * reach; k++) {
          const g = Math.min(Math.max(f + k, 0), motion.frames - 1), w = Math.exp((-0.5 * k * k) / (reach * reach));
          sum += w * motion.values[g * motion.stride + 2 * axis];
          weight += w;
        }
        focus[2 * f + axis] = sum / weight;
      }
    return focus;
  }

  function pose(motion, seconds) {
    const at = Math.min(Math.max(seconds, 0) * motion.fps, motion.frames - 1);
    const low = Math.floor(at), high = Math.min(low + 1, motion.frames - 1), share = at - low;
    const mix = (a, i, j) => a[i] * (1 - share) + a[j] * share;
    const joints = [];
    for (let j = 0; j < motion.joints; j++) {
      const i = low * motion.stride + 3 * j, k = high * motion.stride + 3 * j;
      joints.push([mix(motion.values, i, k), mix(motion.values, i + 1, k + 1), mix(motion.values, i + 2, k + 2)]);
    }
    const focus = [mix(motion.focus, 2 * low, 2 * high), motion.top * 0.47, mix(motion.focus, 2 * low + 1, 2 * high + 1)];
    return { joints, focus, frame: at };
  }

  function camera(view, focus, width, height, distance) {
    const ce = Math.cos(view.elevation), se = Math.sin(view.elevation);
    const ca = Math.cos(view.azimuth), sa = Math.sin(view.azimuth);
    const forward = [-ce * sa, -se, -ce * ca], right = [ca, 0, -sa], down = [se * sa, -ce, se * ca];
    const far = distance * view.zoom, eye = focus.map((v, i) => v - far * forward[i]);
    return (p) => {
      const d = [p[0] - eye[0], p[1] - eye[1], p[2] - eye[2]];
      const dot = (a) => a[0] * d[0] + a[1] * d[1] + a[2] * d[2];
      const depth = dot(forward), scale = depth > 0.05 ? (FOCAL * height) / depth : 0;
      return { x: width / 2 + dot(right) * scale, y: height / 2 + dot(down) * scale, scale, depth };
    };
  }

  function drawFloor(ctx, project, focus, size) {
    const reach = Math.ceil(size * 1.3) + 1, cx = Math.round(focus[0]), cz = Math.round(focus[2]);
    for (let i = -reach; i <= reach; i++)
      for (const [a, b] of [[[cx + i, 0, cz - reach], [cx + i, 0, cz + reach]], [[cx - reach, 0, cz + i], [cx + reach, 0, cz + i]]]) {
        const n = 2 * reach;
        for (let k = 0; k < n; k++) {
          const at = (t) => project([a[0] + ((b[0] - a[0]) * t) / n, 0, a[2] + ((b[2] - a[2]) * t) / n]);
          const p = at(k), q = at(k + 1);
          if (!p.scale || !q.scale) continue;
          const fade = Math.max(0, 1 - Math.abs(k + 0.5 - reach) / reach) * Math.max(0, 1 - Math.abs(i) / reach);
          ctx.strokeStyle = "rgba(170,180,196," + (0.75 * fade).toFixed(3) + ")";
          ctx.lineWidth = (a[0] === b[0] ? a[0] : a[2]) % 2 ? 0.7 : 1.3;
          ctx.beginPath(); ctx.moveTo(p.x, p.y); ctx.lineTo(q.x, q.y); ctx.stroke();
        }
      }
  }

  function drawPath(ctx, motion, project, now) {
    if (!motion.travels) return;
    const every = Math.max(1, Math.floor(motion.frames / 400));
    let last = null;
    for (let f = 0; f < motion.frames; f += every) {
      const p = project([motion.values[f * motion.stride], 0, motion.values[f * motion.stride + 2]]);
      if (last && last.scale && p.scale) {
        ctx.strokeStyle = f <= now ? "rgba(226,164,58,0.95)" : "rgba(226,164,58,0.3)";
        ctx.lineWidth = 0.028 * p.scale;
        ctx.beginPath(); ctx.moveTo(last.x, last.y); ctx.lineTo(p.x, p.y); ctx.stroke();
      }
      last = p;
    }
  }

  // Adds the outline of a tapered capsule to the current path, always in the same direction.
  function capsule(ctx, a, b, ra, rb) {
    const dx = b.x - a.x, dy = b.y - a.y, d = Math.hypot(dx, dy), angle = Math.atan2(dy, dx);
    if (d <= Math.abs(ra - rb)) {
      const big = ra > rb ? a : b, r = Math.max(ra, rb);
      ctx.moveTo(big.x + r, big.y);
      ctx.arc(big.x, big.y, r, 0, 2 * Math.PI);
    } else {
      const lean = Math.acos((ra - rb) / d);
      ctx.moveTo(a.x + ra * Math.cos(angle + lean), a.y + ra * Math.sin(angle + lean));
      ctx.arc(a.x, a.y, ra, angle + lean, angle - lean + 2 * Math.PI);
      ctx.arc(b.x, b.y, rb, angle - lean, angle + lean);
    }
    ctx.closePath();
  }

  const shade = (c, k) => "rgb(" + c.map((v) => Math.round(Math.min(255, v * k))).join(",") + ")";

  function drawFigure(ctx, motion, joints, project) {
    const parts = motion.limbs.map(([begin, end, ra, rb, side, reach]) => {
      let a = joints[begin], b = joints[end];
      if (reach) {
        const d = a.map((v, i) => b[i] - v), n = Math.hypot(d[0], d[1], d[2]) || 1;
        a = b.map((v, i) => v + (d[i] / n) * reach * 0.35);
        b = b.map((v, i) => v + (d[i] / n) * reach);
      }
      const p = project(a), q = project(b);
      return { a, b, p, q, ra, rb, side, depth: (p.depth + q.depth) / 2 - Math.max(ra, rb) };
    }).filter((part) => part.p.scale && part.q.scale);
    ctx.fillStyle = "rgba(92,102,122,0.28)";
    ctx.beginPath();  // one path, so that shadows do not add up where limbs cross
    for (const part of parts) {
      const fall = (v) => project([v[0] + v[1] * 0.28, 0, v[2] + v[1] * 0.12]);
      const p = fall(part.a), q = fall(part.b);
      if (p.scale && q.scale) capsule(ctx, p, q, 0.7 * part.ra * p.scale, 0.7 * part.rb * q.scale);
    }
    ctx.fill();
    parts.sort((x, y) => y.depth - x.depth);
    for (const { p, q, ra, rb, side } of parts) {
      const r = Math.max(ra * p.scale, rb * q.scale, 0.5), dx = q.x - p.x, dy = q.y - p.y, d = Math.hypot(dx, dy) || 1;
      let nx = -dy / d, ny = dx / d;  // across the limb, towards the light at the upper left
      if (nx * -0.5 + ny * -0.8 < 0) { nx = -nx; ny = -ny; }
      const mx = (p.x + q.x) / 2, my = (p.y + q.y) / 2;
      const g = ctx.createLinearGradient(mx + nx * r, my + ny * r, mx - nx * r, my - ny * r), c = COLORS[side];
      g.addColorStop(0, shade(c, 1.0)); g.addColorStop(0.35, shade(c, 1.12)); g.addColorStop(1, shade(c, 0.66));
      ctx.fillStyle = g;
      ctx.beginPath();
      capsule(ctx, p, q, ra * p.scale, rb * q.scale);
      ctx.fill();
    }
  }

  function start(root) {
    const data = JSON.parse(root.querySelector("script").textContent);
    data.motions.forEach(decode);
    const duration = Math.max(...data.motions.map((m) => m.duration), 0.001);
    const scrub = root.querySelector("input"), play = root.querySelector("button");
    const speed = root.querySelector("select"), clock = root.querySelector("output");
    const canvases = Array.from(root.querySelectorAll("canvas"));
    const view = { azimuth: 0, elevation: 0.25, zoom: 1 };
    let seconds = 0, playing = data.autoplay, before = 0, dirty = true, visible = true;

    function draw() {
      canvases.forEach((canvas, i) => {
        const motion = data.motions[i], ratio = window.devicePixelRatio || 1;
        const width = canvas.clientWidth, height = canvas.clientHeight;
        if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
          canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio);
        }
        const ctx = canvas.getContext("2d");
        ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
        const sky = ctx.createLinearGradient(0, 0, 0, height);
        sky.addColorStop(0, "#e2e8f0"); sky.addColorStop(0.5, "#f4f6f9"); sky.addColorStop(1, "#eceff4");
        ctx.fillStyle = sky; ctx.fillRect(0, 0, width, height);
        const { joints, focus, frame } = pose(motion, seconds);
        const turned = { azimuth: view.azimuth + motion.azimuth, elevation: view.elevation, zoom: view.zoom };
        const project = camera(turned, focus, width, height, motion.distance);
        drawFloor(ctx, project, focus, motion.distance);
        drawPath(ctx, motion, project, frame);
        drawFigure(ctx, motion, joints, project);
      });
      scrub.value = Math.round((1000 * seconds) / duration);
      clock.textContent = seconds.toFixed(1) + " / " + duration.toFixed(1) + " s";
      play.textContent = playing ? "\u275A\u275A" : "\u25B6";
      play.setAttribute("aria-label", playing ? "pause" : "play");
    }

    function tick(now) {
      const passed = Math.min((now - before) / 1000, 0.1);
      before = now;
      if (playing && visible) {
        seconds += passed * Number(speed.value);
        if (seconds > duration) seconds = 0;
        dirty = true;
      }
      if (dirty && visible) { draw(); dirty = false; }
      requestAnimationFrame(tick);
    }

    play.onclick = () => { playing = !playing; dirty = true; };
    scrub.oninput = () => { seconds = (Number(scrub.value) / 1000) * duration; playing = false; dirty = true; };
    canvases.forEach((canvas) => {
      let held = null;
      canvas.onpointerdown = (e) => { held = [e.clientX, e.clientY]; canvas.setPointerCapture(e.pointerId); };
      canvas.onpointerup = canvas.onpointercancel = () => { held = null; };
      canvas.onpointermove = (e) => {
        if (!held) return;
        view.azimuth -= (e.clientX - held[0]) * 0.01;
        view.elevation = Math.min(1.5, Math.max(0.02, view.elevation + (e.clientY - held[1]) * 0.01));
        held = [e.clientX, e.clientY];
        dirty = true;
      };
      canvas.onwheel = (e) => {
        e.preventDefault();
        view.zoom = Math.min(4, Math.max(0.3, view.zoom * Math.exp(e.deltaY * 0.001)));
        dirty = true;
      };
    });
    window.addEventListener("resize", () => { dirty = true; });
    if (window.IntersectionObserver)
      new IntersectionObserver((seen) => { visible = seen[seen.length - 1].isIntersecting; dirty = true; }).observe(root);
    root.player = { get seconds() { return seconds; }, get playing() { return playing; }, view };
    requestAnimationFrame(tick);
  }

  window.motionaryPlayers = () =>
    document.querySelectorAll(".motionary:not([data-started])").forEach((root) => {
      root.setAttribute("data-started", "");
      start(root);
    });
  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", window.motionaryPlayers);
  else window.motionaryPlayers();
})();
