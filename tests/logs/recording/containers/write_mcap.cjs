// Copies a log with @mcap/core's own writer, with its options as JSON.
// node write_mcap.cjs NODE_MODULES LOG.mcap COPY.mcap '{"useChunks": false}'
const { createRequire } = require("node:module");
const { readFileSync, writeFileSync } = require("node:fs");
const there = createRequire(process.argv[2] + "/here.js");
const { McapStreamReader, McapWriter, TempBuffer } = there("@mcap/core");
const { loadDecompressHandlers } = there("@mcap/support");

async function main() {
  const out = new TempBuffer();
  const writer = new McapWriter({ writable: out, ...JSON.parse(process.argv[5]) });
  await writer.start({ profile: "", library: "another" });
  const reader = new McapStreamReader({ decompressHandlers: await loadDecompressHandlers(), validateCrcs: true });
  reader.append(readFileSync(process.argv[3]));
  const schemas = new Map([[0, 0]]), channels = new Map();
  for (let record; (record = reader.nextRecord()); ) {
    if (record.type === "Schema" && !schemas.has(record.id)) schemas.set(record.id, await writer.registerSchema(record));
    if (record.type === "Channel" && !channels.has(record.id))
      channels.set(record.id, await writer.registerChannel({ ...record, schemaId: schemas.get(record.schemaId) }));
    if (record.type === "Message") await writer.addMessage({ ...record, channelId: channels.get(record.channelId) });
    if (record.type === "Attachment") await writer.addAttachment(record);
  }
  await writer.addMetadata({ name: "note", metadata: new Map([["by", "another"]]) });
  await writer.end();
  writeFileSync(process.argv[4], out.get());
}
main();
