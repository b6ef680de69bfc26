// Khronos' glTF validator over files: validate.cjs FOLDER_OF_NODE_MODULES FILE...
// A line a file; exit code 1 if one has errors.
const fs = require('fs');
const path = require('path');
const [modules, ...files] = process.argv.slice(2);
const validator = require(path.join(modules, 'gltf-validator'));

(async () => {
  let bad = false;
  for (const file of files) {
    const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)), {
      uri: path.basename(file),
      externalResourceFunction: (uri) => fs.promises.readFile(path.join(path.dirname(file), decodeURIComponent(uri))),
    });
    const { numErrors, numWarnings, messages } = report.issues;
    console.log(`${path.basename(file)}: ${numErrors} errors, ${numWarnings} warnings`);
    for (const m of messages.filter((m) => m.severity <= 1).slice(0, 10)) console.log(`  ${m.code} ${m.pointer ?? ''}: ${m.message}`);
    bad ||= numErrors > 0;
  }
  process.exit(bad ? 1 : 0);
})();
