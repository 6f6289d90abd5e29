// What is drawn only while it is seen: its element is in the window, and the tab is shown.

// Returns a function that asks for `draw`: it is called once for all that ask within `pauseMs`, with a frame of the screen.
export function drawnInView(element, draw, pauseMs = 0) {
  let asked = false, pending = false, inView = false;
  function begin() {
    if (!asked || !inView || pending) return;
    pending = true;
    setTimeout(() => requestAnimationFrame(() => { // which a hidden tab has none of
      asked = pending = false;
      draw();
    }), pauseMs);
  }
  new IntersectionObserver((changes) => {
    inView = changes[changes.length - 1].isIntersecting;
    begin();
  }).observe(element);
  return () => {
    asked = true;
    begin();
  };
}
