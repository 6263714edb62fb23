// Keeps everything that goes wrong from the first moment on.
window.faults = [];
window.addEventListener(
  "error",
  (event) => window.faults.push("error: " + (event.message || event.target.outerHTML.slice(0, 80))),
  true,
);
window.addEventListener("unhandledrejection", (event) => window.faults.push("rejected: " + event.reason));
document.addEventListener("securitypolicyviolation", (event) => window.faults.push("blocked: " + event.blockedURI));
for (const name of ["error", "warn"]) {
  console[name] = (...words) => window.faults.push(name + ": " + words.join(" "));
}
