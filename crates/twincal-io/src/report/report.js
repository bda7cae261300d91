// Draws the traces of the page's data block: joint picker, hover values, zoom, pan, CSV. Without it the page shows its static figures.
"use strict";
(() => {
  const block = document.getElementById("traces");
  const live = document.getElementById("live");
  if (!block || !live) return;
  const { first, traces } = JSON.parse(block.textContent);
  const at = (id) => document.getElementById(id);
  const places = [at("plot-torque"), at("plot-residual")];
  const picker = at("joint");
  // Height of the torque plot and of the residual below it, px.
  const heights = () => (window.innerWidth <= 700 ? [210, 130] : [250, 150]);
  let plots = [];
  let shown = traces[first];

  /** The value of a custom property of the style sheet, in the light or dark theme in force. */
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  const difference = (a, b) => a.map((value, row) => (value === null || b[row] === null ? null : value - b[row]));
  const digits = (value, text = (x) => (Math.abs(x) < 1e4 ? x.toPrecision(4) : x.toFixed(0))) =>
    value === null || value === undefined ? "–" : text(value).replace("-", "−");
  const seconds = (time) => digits(time, (x) => x.toFixed(2));

  /** Columns of the shown trace, in the order of the CSV file. */
  const columns = (trace) => ({
    time_s: trace.time,
    ...(trace.logged.length > 0 ? { as_logged: trace.logged } : {}),
    measured: trace.measured,
    nominal: trace.nominal,
    calibrated: trace.calibrated,
    low95: trace.low,
    high95: trace.high,
    residual_nominal: difference(trace.measured, trace.nominal),
    residual_calibrated: difference(trace.measured, trace.calibrated),
  });

  /** Grey areas where the joint is at rest, and a line at zero. */
  const background = (trace) => (plot) => {
    const { ctx, bbox } = plot;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.fillStyle = colour("still");
    for (const [from, to] of trace.rest) {
      const left = plot.valToPos(from, "x", true);
      ctx.fillRect(left, bbox.top, Math.max(1, plot.valToPos(to, "x", true) - left), bbox.height);
    }
    ctx.strokeStyle = colour("measured");
    ctx.lineWidth = 1;
    ctx.setLineDash([]);
    const zero = Math.round(plot.valToPos(0, "y", true)) + 0.5;
    ctx.beginPath();
    ctx.moveTo(bbox.left, zero);
    ctx.lineTo(bbox.left + bbox.width, zero);
    ctx.stroke();
    ctx.restore();
  };

  /** The largest range of time that the shown trace has. */
  const whole = () => [shown.time[0], shown.time[shown.time.length - 1]];

  /** Shows this range of time in both plots, moved back into the trace where it leaves it. */
  const show = (low, high) => {
    const [start, end] = whole();
    const width = Math.min(Math.max(high - low, (end - start) / 500), end - start);
    const from = Math.min(Math.max(low, start), end - width);
    for (const plot of plots) plot.setScale("x", { min: from, max: from + width });
  };
  const zoom = (factor) => {
    const { min, max } = plots[0].scales.x;
    const [middle, half] = [(min + max) / 2, ((max - min) / 2) * factor];
    show(middle - half, middle + half);
  };
  const pan = (share) => {
    const { min, max } = plots[0].scales.x;
    show(min + share * (max - min), max + share * (max - min));
  };
  const actions = {
    "zoom-in": () => zoom(0.5),
    "zoom-out": () => zoom(2),
    left: () => pan(-0.25),
    right: () => pan(0.25),
    all: () => show(...whole()),
  };

  /** Shift and drag moves the range; a drag alone stays uPlot's zoom. */
  const press = (plot, target, handler) => (event) => {
    if (!event.shiftKey) return handler(event);
    const { min, max } = plot.scales.x;
    const perPixel = (max - min) / plot.over.clientWidth;
    const move = (now) => {
      const by = (event.clientX - now.clientX) * perPixel;
      show(min + by, max + by);
    };
    document.addEventListener("mousemove", move);
    document.addEventListener("mouseup", () => document.removeEventListener("mousemove", move), { once: true });
    return null;
  };

  /** Both plots show one range; the line below them says which. */
  const follow = (plot, scale) => {
    if (scale !== "x") return;
    const { min, max } = plot.scales.x;
    for (const other of plots) {
      if (other !== plot && (other.scales.x.min !== min || other.scales.x.max !== max)) other.setScale("x", { min, max });
    }
    const rows = shown.time.length < shown.rows ? `, ${shown.time.length} of ${shown.rows} rows` : "";
    const rest = shown.rest.length > 0 ? ", grey: at rest" : "";
    at("range").textContent = `${seconds(min)} to ${seconds(max)} s${rows}${rest}`;
  };

  const line = (label, name, width, dash) => ({
    label,
    stroke: colour(name),
    width,
    dash,
    points: { show: false },
    value: (_, value) => digits(value),
  });
  // Ends of the band: no line of their own, and no say in the range of the axis.
  const end = (label) => ({ ...line(label, "calibrated", 0), auto: false });
  const axis = (label, more) => ({
    label,
    labelSize: 16,
    labelFont: "11px system-ui, sans-serif",
    font: "11px system-ui, sans-serif",
    stroke: colour("muted"),
    grid: { stroke: colour("grid"), width: 1 },
    ticks: { show: false },
    ...more,
  });

  /** One plot over time; `series` without the time. */
  const plot = (index, label, series, data) => {
    const place = places[index];
    place.setAttribute("aria-label", `${label} of ${shown.joint} in ${shown.log} over time. Arrow keys move, + and − zoom, 0 shows all.`);
    const bottom = index === 1;
    const options = {
      width: place.clientWidth,
      height: heights()[index],
      scales: { x: { time: false }, y: { range: (_, low, high) => uPlot.rangeNum(low ?? 0, high ?? 1, 0.12, true) } },
      series: [{ label: "t (s)", value: (_, value) => seconds(value) }, ...series],
      bands: [{ series: [2, 1], fill: colour("band") }],
      axes: [
        axis(bottom ? "time (s)" : undefined, bottom ? { size: 26 } : { size: 8, values: (_, ticks) => ticks.map(() => "") }),
        axis(`${label} (${shown.unit})`, { size: 52 }),
      ],
      cursor: { sync: { key: "time" }, drag: { x: true, y: false }, bind: { mousedown: press } },
      legend: { markers: { width: 0, fill: (own, index) => (index === 1 || index === 2 ? colour("band") : own.series[index].stroke()) } },
      padding: [8, 8, 0, 0],
      hooks: { drawAxes: [background(shown)], setScale: [follow] },
    };
    return new uPlot(options, data, place);
  };

  /** Draws the shown trace anew. */
  const draw = () => {
    for (const old of plots) old.destroy();
    plots = [];
    const { time, logged, measured, nominal, calibrated, low, high } = shown;
    const band = [end("95 % low"), end("95 % high")];
    // Behind the others, and only where a filter makes it another line.
    const [behind, raw] = logged.length > 0 ? [[line("as logged", "logged", 0.8)], [logged]] : [[], []];
    const torque = plot(
      0,
      "torque",
      [...band, ...behind, line("measured", "measured", 2.4), line("before (nominal)", "nominal", 1.4, [4, 4]), line("after (calibrated)", "calibrated", 1.6)],
      [time, low, high, ...raw, measured, nominal, calibrated],
    );
    const residual = plot(
      1,
      "residual",
      [...band, line("before", "nominal", 1.2), line("after", "calibrated", 1.4)],
      [time, difference(low, calibrated), difference(high, calibrated), difference(measured, nominal), difference(measured, calibrated)],
    );
    plots = [torque, residual];
    at("error").textContent = shown.error;
    follow(torque, "x");
  };

  /** Offers the shown trace as a CSV file. Names go into the file's name alone, and there as letters. */
  const save = () => {
    const all = columns(shown);
    const names = Object.keys(all);
    const rows = shown.time.map((_, row) => names.map((name) => all[name][row] ?? "").join(","));
    const text = [names.join(","), ...rows].join("\r\n") + "\r\n";
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
    link.download = `torque_${shown.joint}_${shown.log}`.replace(/[^A-Za-z0-9_-]+/g, "_").slice(0, 80) + ".csv";
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  };

  traces.forEach((trace, index) => {
    const several = traces.some((other) => other !== trace && other.joint === trace.joint);
    picker.add(new Option(several ? `${trace.joint}, ${trace.log}` : trace.joint, index, index === first, index === first));
  });
  picker.addEventListener("change", () => {
    shown = traces[picker.value];
    draw();
  });
  for (const button of live.querySelectorAll("button[data-do]")) button.addEventListener("click", actions[button.dataset.do]);
  at("csv").addEventListener("click", save);
  const keys = { ArrowLeft: "left", ArrowRight: "right", "+": "zoom-in", "-": "zoom-out", 0: "all" };
  for (const place of places) {
    place.addEventListener("keydown", (event) => {
      const action = keys[event.key];
      if (!action || event.ctrlKey || event.altKey || event.metaKey) return;
      event.preventDefault();
      actions[action]();
    });
  }
  /** A link to a closed section opens it. */
  const open = () => {
    const section = at(decodeURIComponent(location.hash.slice(1)));
    if (section && section.tagName === "DETAILS") section.open = true;
  };
  window.addEventListener("hashchange", open);
  open();

  live.hidden = false;
  document.documentElement.classList.add("scripted");
  draw();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  new ResizeObserver(() => {
    for (const [index, one] of plots.entries()) one.setSize({ width: places[index].clientWidth, height: heights()[index] });
  }).observe(live);
})();
