// Plots, drawn by Chart.js, with the values under the pointer.

import "/chart.js";
import { drawnInView } from "/view.js";

const { Chart } = globalThis; // as the library names itself
const AXIS = "#9fb3c3", GRID = "#22323f";
const PAUSE_MS = 200; // between two drawings of a plot

Object.assign(Chart.defaults.font, { family: "system-ui, sans-serif", size: 11 });
Chart.defaults.color = AXIS;

const ago = (ms, now) => (now - ms < 500 ? "now" : `-${Math.round((now - ms) / 1000)} s`);

// Of the last seconds: as many as there are values for.
function span(now, lines) {
  const oldest = Math.min(now, ...[...lines].map(({ points }) => points[0].x));
  return [15000, 30000, 60000].find((some) => now - oldest < some) || 120000;
}

export function draw(plot) {
  let now = performance.now();
  const chart = new Chart(plot.canvas, {
    type: "line",
    data: { datasets: [] },
    options: {
      animation: false, parsing: false, normalized: true, maintainAspectRatio: false,
      interaction: { mode: "nearest", axis: "x", intersect: false },
      elements: { point: { radius: 0, hoverRadius: 3 }, line: { borderWidth: 1.7, borderJoinStyle: "round" } },
      plugins: {
        legend: { display: false }, // it is text beside the plot
        tooltip: { animation: false, callbacks: { title: ([item]) => item && ago(item.parsed.x, now), label: (item) => `${item.dataset.label} ${plot.say(item.parsed.y)}` } },
      },
      scales: {
        x: {
          type: "linear", grid: { display: false }, border: { display: false },
          afterBuildTicks: (axis) => { axis.ticks = [axis.min, (axis.min + axis.max) / 2, axis.max].map((value) => ({ value })); },
          ticks: { align: "inner", maxRotation: 0, autoSkip: false, callback: (value) => ago(value, now) },
        },
        y: { beginAtZero: true, grace: "5%", grid: { color: GRID, drawBorder: false }, ticks: { maxTicksLimit: 5 }, afterFit: (axis) => { axis.width = 46; } },
      },
    },
  });

  function update() {
    now = performance.now();
    const lines = [...plot.lines.values()];
    Object.assign(chart.options.scales.x, { min: now - span(now, lines), max: now });
    chart.data.datasets = lines.map((line) => (line.dataset ||= { label: line.name, data: line.points, borderColor: line.colour, backgroundColor: line.colour }));
    chart.update("none");
  }
  plot.onChange = drawnInView(plot.canvas, update, PAUSE_MS);
  plot.chart = chart;
  update();
}
