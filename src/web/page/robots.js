// Which of several robots this page shows. The choice stands in the address, behind #, so that it outlives the page.

import { byId } from "/panels.js";

export class Robots {
  constructor(link) {
    this.link = link;
    this.wanted = new URLSearchParams(location.hash.slice(1)).get("robot");
    byId("robot-choice").addEventListener("change", () => this.choose(byId("robot-choice").selectedIndex));
  }
  choose(number) {
    this.wanted = this.names[number];
    history.replaceState(null, "", "#robot=" + encodeURIComponent(this.wanted));
    this.link().say("robot " + number);
  }
  // After each connection the first one is shown.
  show({ robots, shown }) {
    const select = byId("robot-choice");
    this.names = robots.map((robot) => robot.name);
    byId("robots").hidden = robots.length < 2;
    const words = robots.map(({ name, running, state }) => `${name}: ${running ? state || "no pose yet" : "no run"}`);
    if (select.options.length !== words.length) select.replaceChildren(...words.map((text) => new Option(text)));
    words.forEach((text, i) => { if (select.options[i].text !== text) select.options[i].text = text; });
    const wanted = this.names.indexOf(this.wanted);
    if (wanted >= 0 && wanted !== shown) this.link().say("robot " + wanted);
    else select.selectedIndex = shown;
  }
}
