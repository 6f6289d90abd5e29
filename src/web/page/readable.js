// A page that came without encryption from another host says so.

const { protocol, hostname } = location;
document.getElementById("readable").hidden = protocol !== "http:" || hostname === "localhost" || hostname.startsWith("127.");
