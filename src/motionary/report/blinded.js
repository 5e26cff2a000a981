// A visit to the page of blinded comparisons: order and sides drawn anew, one pair at a time, answers saved as JSON.
(function () {
  "use strict";
  const $ = (id) => document.getElementById(id);
  const packed = atob($("study").textContent.trim());
  const study = JSON.parse(new TextDecoder().decode(Uint8Array.from(packed, (c) => c.charCodeAt(0))));
  const sections = Array.from(document.querySelectorAll("#asking section"));
  document.querySelectorAll(".question").forEach((heading) => { heading.textContent = study.question; });

  function shuffled(list) {
    for (let i = list.length - 1; i > 0; i--) {
      const k = Math.floor(Math.random() * (i + 1));
      [list[i], list[k]] = [list[k], list[i]];
    }
    return list;
  }

  // Warm-ups come first; catch trials lie anywhere among the pairs.
  const of = (warm) => shuffled(study.trials.filter((trial) => (trial.kind === "warm-up") === warm));
  const order = [...of(true), ...of(false)], answers = [];
  let began = 0, left = "a";
  $("count").textContent = order.length;
  document.querySelector("progress").max = order.length;

  function show() {
    const trial = order[answers.length];
    sections.forEach((section, i) => { section.hidden = i !== trial.id; });
    const row = sections[trial.id].querySelector(".row");
    left = Math.random() < 0.5 ? "a" : "b";
    // The player keeps its canvases whatever their order on the page.
    if (left === "b") row.append(row.firstElementChild);
    $("text").textContent = trial.text ? "\u201c" + trial.text + "\u201d" : "";
    document.querySelector("progress").value = answers.length;
    window.dispatchEvent(new Event("resize"));
    began = Date.now();
  }

  function answer(side) {
    const { id, kind, text } = order[answers.length];
    const chosen = (side === "left") === (left === "a") ? "a" : "b";
    answers.push({ id, kind, text, left, chosen, seconds: (Date.now() - began) / 1000 });
    if (answers.length < order.length) return show();
    $("asking").hidden = true;
    $("thanks").hidden = false;
  }

  // Share of answers for a, with Wilson's 95% interval.
  function result() {
    const counted = answers.filter((given) => given.kind === "pair"), n = counted.length;
    const share = counted.filter((given) => given.chosen === "a").length / n, z = 1.959964, zz = (z * z) / n;
    const middle = (share + zz / 2) / (1 + zz);
    const half = (z / (1 + zz)) * Math.sqrt((share * (1 - share)) / n + zz / (4 * n));
    return { share, low: middle - half, high: middle + half, answers: n };
  }

  function save() {
    const passed = answers.every((given) => given.kind !== "catch" || given.chosen === "a");
    const told = { question: study.question, a: study.a, b: study.b, rater: $("rater").value, passed, result: result(), answers };
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([JSON.stringify(told, null, 1)], { type: "application/json" }));
    link.download = "answers.json";
    link.click();
  }

  $("begin").onclick = () => { $("welcome").hidden = true; $("asking").hidden = false; show(); };
  $("left").onclick = () => answer("left");
  $("right").onclick = () => answer("right");
  $("save").onclick = save;
})();
