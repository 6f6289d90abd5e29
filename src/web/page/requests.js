// Requests to the run, which answers through the feed. Until it is sent a request has a number of this page, then that of its message.

const SENT_MS = 20000, ANSWERED_MS = 20000; // a robot that lacks the processor is slow to answer
const NO_ANSWER = "no answer of the run (its keys listen, commands and command_key)";

export class Requests {
  constructor(link) {
    this.link = link;
    this.last = 0;
    this.waiting = new Map(); // by request, until sent; by id, until answered
    this.early = new Map(); // answers that came before the number of their message
  }
  // Say words(number); resolves with the answer, rejects with the reason why there is none.
  ask(words) {
    const request = ++this.last;
    return new Promise((answered, failed) => {
      this.wait(request, { answered, failed }, SENT_MS, "not sent");
      this.link().say(words(request));
    });
  }
  // The same for what is posted to a path of the server, which answers with the number of its message.
  async post(path, text) {
    const answer = await fetch(path, { method: "POST", body: text }), id = (await answer.text()).trim();
    if (!answer.ok) throw new Error("refused: " + id);
    return new Promise((answered, failed) => {
      this.wait(id, { answered, failed }, ANSWERED_MS, NO_ANSWER);
      if (this.early.has(id)) this.answer(this.early.get(id));
    });
  }
  wait(number, waiting, ms, reason) {
    this.waiting.set(number, waiting);
    clearTimeout(waiting.timer);
    waiting.timer = setTimeout(() => this.fail(number, reason), ms);
  }
  take(number) {
    const waiting = this.waiting.get(number);
    this.waiting.delete(number);
    if (waiting) clearTimeout(waiting.timer);
    return waiting;
  }
  fail(number, reason) {
    const waiting = this.take(number);
    if (waiting) waiting.failed(new Error(reason));
  }
  sent({ request, id }) {
    const waiting = this.take(request);
    if (!waiting) return;
    this.wait(id, waiting, ANSWERED_MS, NO_ANSWER);
    if (this.early.has(id)) this.answer(this.early.get(id));
  }
  refused({ request, reason }) {
    this.fail(request, "refused: " + reason);
  }
  answer(result) {
    const id = String(result.id), waiting = this.take(id);
    if (waiting) waiting.answered(result);
    else this.early.set(id, result);
    if (this.early.size > 16) this.early.delete(this.early.keys().next().value);
  }
}
