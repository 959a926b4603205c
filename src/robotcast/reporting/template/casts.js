"use strict";
// A table of trials to sort, and a player of the chosen one. Paths come in the drawing's places.
for (const block of document.querySelectorAll(".casts")) {
  const data = JSON.parse(block.querySelector(".paths").textContent);
  const trials = new Map(data.trials.map((trial) => [String(trial.trial), trial]));
  const stage = block.querySelector(".stage");
  const slider = block.querySelector("input");
  const play = block.querySelector(".play");
  const clock = block.querySelector("output");
  const reading = block.querySelector(".reading");
  const INK = "#1f2937", RED = "#d55e00";
  let trial = null, dots = [], playing = 0, last = 0;

  const element = (name, attributes) => {
    const made = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    return made;
  };
  const way = (places) => "M" + places.map((place) => place.join(" ")).join("L");

  // where between two samples a time lies: the earlier one, and the part of the way to the next
  const at = (time) => {
    const t = trial.t;
    let i = t.findIndex((later) => later > time);
    if (i < 0) return [t.length - 1, 0];
    if (i === 0) return [0, 0];
    return [i - 1, (time - t[i - 1]) / (t[i] - t[i - 1])];
  };
  const between = (list, [i, part]) =>
    part ? list[i] + part * (list[i + 1] - list[i]) : list[i];

  function draw() {
    stage.replaceChildren();
    dots = [];
    const { measured, predicted } = trial;
    predicted.forEach((places, lane) => {
      const joints = places.map((p, i) => `M${measured[lane][i].join(" ")}L${p.join(" ")}`);
      stage.append(element("path", { d: joints.join(""), stroke: "#a4abb8" }));
    });
    for (const [paths, colour] of [[measured, INK], [predicted, RED]]) {
      for (const places of paths) {
        stage.append(
          element("path", { d: way(places), stroke: colour, "stroke-width": 1.4, "stroke-opacity": 0.45 }),
        );
        for (const [cx, cy] of places) stage.append(element("circle", { cx, cy, r: 1.8, fill: colour }));
        const trail = element("path", { stroke: colour, "stroke-width": 2.6, "stroke-linejoin": "round" });
        const dot = element("circle", { r: 6, fill: colour, stroke: "#fff", "stroke-width": 1.5 });
        stage.append(trail, dot);
        dots.push({ places, trail, dot });
      }
    }
  }

  function show(time) {
    const where = at(time);
    for (const { places, trail, dot } of dots) {
      const here = [0, 1].map((k) => between(places.map((place) => place[k]), where));
      dot.setAttribute("cx", here[0]);
      dot.setAttribute("cy", here[1]);
      trail.setAttribute("d", way([...places.slice(0, where[0] + 1), here]));
    }
    const phase = trial.phases.filter(([start]) => start <= time).pop();
    clock.textContent = `${time.toFixed(2)} s`;
    const error = trial.predicted.length
      ? `${between(trial.error, where).toFixed(1)} ${data.unit}`
      : "the simulation diverged";
    reading.textContent = (phase ? `${phase[1]}, ` : "") + error;
  }

  function stop() {
    cancelAnimationFrame(playing);
    playing = 0;
    play.textContent = "▶";
    play.setAttribute("aria-label", "play");
  }

  function step(now) {
    const time = Math.min(Number(slider.value) + (now - last) / 1000, Number(slider.max));
    last = now;
    slider.value = time;
    show(time);
    if (time < Number(slider.max)) playing = requestAnimationFrame(step);
    else stop();
  }

  function choose(number) {
    if (!trials.has(number)) return;
    stop();
    trial = trials.get(number);
    slider.min = trial.t[0];
    slider.max = trial.t.at(-1);
    slider.value = slider.max;
    block.querySelector(".which").textContent = `${data.word} ${number}:`;
    for (const one of block.querySelectorAll("tr.pick, button.pick")) {
      one.classList.toggle("chosen", one.dataset.trial === number);
    }
    draw();
    show(Number(slider.value));
  }

  play.addEventListener("click", () => {
    if (playing) return stop();
    if (Number(slider.value) >= Number(slider.max)) slider.value = slider.min;
    play.textContent = "❚❚";
    play.setAttribute("aria-label", "pause");
    last = performance.now();
    playing = requestAnimationFrame(step);
  });
  slider.addEventListener("input", () => {
    stop();
    show(Number(slider.value));
  });

  const picked = (event) => {
    const one = event.target.closest(".pick");
    if (!one) return;
    choose(one.dataset.trial);
    if (!block.contains(one)) block.querySelector(".player").scrollIntoView({ behavior: "smooth" });
  };
  document.addEventListener("click", picked);
  block.addEventListener("keydown", (event) => {
    if (event.key === "Enter" && event.target.matches("tr.pick")) picked(event);
  });

  const body = block.querySelector("tbody");
  const heads = [...block.querySelectorAll(".sortable thead th")];
  heads.forEach((head, column) => head.addEventListener("click", () => {
    const falling = head.getAttribute("aria-sort") !== "descending";
    heads.forEach((other) => other.removeAttribute("aria-sort"));
    head.setAttribute("aria-sort", falling ? "descending" : "ascending");
    const value = (row) => Number(row.children[column].dataset.value);
    const rows = [...body.rows].sort((a, b) => (falling ? value(b) - value(a) : value(a) - value(b)));
    body.append(...rows);
  }));

  choose(body.rows[0].dataset.trial);
}
