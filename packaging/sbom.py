#!/usr/bin/env python3
"""Writes a CycloneDX 1.5 list of the programs in a folder and of what each links; of model files also their cards.

    packaging/sbom.py BIN --version 0.2.0 [--out FILE] [MODEL ...]

The libraries are those that the programs themselves name, with the Debian package and version they came from; the
headers that are compiled in are listed besides. The same programs give the same bytes.
"""
import argparse
import functools
import hashlib
import json
import pathlib
import re
import subprocess

COMPILED_IN = ("nlohmann-json3-dev", "libcxxopts-dev", "libstb-dev")


@functools.cache
def output(*words):
    done = subprocess.run(words, capture_output=True, text=True)
    return done.stdout if done.returncode == 0 else ""


def package(name, kind="library"):
    """A component for a Debian package, or None when it is not installed."""
    native = output("dpkg", "--print-architecture").strip()
    rows = [row.split() for row in output("dpkg-query", "-W", "-f", "${Architecture} ${Version}\\n", name).splitlines()]
    found = next((row for row in rows if len(row) == 2 and row[0] in (native, "all")), None)
    if found is None:
        return None
    architecture, version = found
    purl = f"pkg:deb/debian/{name.split(':')[0]}@{version.replace('+', '%2B').replace(':', '%3A')}?arch={architecture}"
    return {"type": kind, "bom-ref": purl, "name": name.split(":")[0], "version": version, "purl": purl}


def needed(program):
    """Packages of the shared libraries that a program names and loads."""
    names = re.findall(r"\(NEEDED\).*\[(.+)\]", output("readelf", "-d", str(program)))
    places = dict(re.findall(r"(\S+) => (\S+)", output("ldd", str(program))))
    found = set()
    for name in names:
        path = places.get(name, "")
        for candidate in (path, str(pathlib.Path(path).resolve()), path.replace("/lib/", "/usr/lib/", 1)):
            owners = output("dpkg-query", "-S", candidate)
            if path and owners:
                found.add(owners.split(": ")[0].split(",")[0])
                break
    return sorted(found)


def program_component(path, version):
    return {"type": "application", "bom-ref": path.name, "name": path.name, "version": version,
            "hashes": [{"alg": "SHA-256", "content": hashlib.sha256(path.read_bytes()).hexdigest()}],
            "licenses": [{"license": {"id": "MIT"}}]}


def model_component(path, info):
    """A model's card, from what its file says."""
    card = json.loads(output(str(info), str(path), "--json", "-"))
    metadata = card["metadata"]
    settings = metadata.get("settings", {})
    said = {key: value if isinstance(value, str) else json.dumps(value) for key, value in metadata.items()}
    return {
        "type": "machine-learning-model", "bom-ref": path.name, "name": path.name,
        "hashes": [{"alg": "SHA-256", "content": hashlib.sha256(path.read_bytes()).hexdigest()}],
        "modelCard": {
            "modelParameters": {
                "approach": {"type": "supervised"}, "task": "tactile super-resolution",
                "architectureFamily": "variational auto-encoders and residual upsampling",
                "modelArchitecture": f"SuperTac {settings.get('preset', '')}, {card['values']} values".strip(),
                "inputs": [{"format": "volts of a tactile array, a window of time"}],
                "outputs": [{"format": "heights of the surface under the array, 0 to 1"}]},
            "considerations": {"technicalLimitations": [
                "Draws well what it was trained on; an unseen texture may be drawn as one that it knows.",
                "A picture is only as good as the position of the recordings that it learnt from."]}},
        "properties": [{"name": f"supertac:{key}", "value": text} for key, text in sorted(said.items())]}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("bin", type=pathlib.Path)
    parser.add_argument("models", nargs="*", type=pathlib.Path)
    parser.add_argument("--version", required=True)
    parser.add_argument("--out", type=pathlib.Path)
    options = parser.parse_intermixed_args()
    components, dependencies = {}, []
    compiled_in = [part for part in map(package, COMPILED_IN) if part]
    for path in sorted(options.bin.glob("supertac*")):
        parts = [part for part in map(package, needed(path)) if part]
        components |= {part["bom-ref"]: part for part in parts + compiled_in}
        components[path.name] = program_component(path, options.version)
        dependencies.append({"ref": path.name, "dependsOn": sorted(p["bom-ref"] for p in parts + compiled_in)})
    for path in options.models:
        components[path.name] = model_component(path, options.bin / "supertac-info")
    compiler = output("c++", "-dumpfullversion").strip()
    bom = {"$schema": "http://cyclonedx.org/schema/bom-1.5.schema.json", "bomFormat": "CycloneDX", "specVersion": "1.5",
           "version": 1,
           "metadata": {"component": {"type": "application", "bom-ref": "supertac", "name": "supertac",
                                      "version": options.version},
                        "properties": [{"name": "supertac:compiler", "value": f"g++ {compiler}"}]},
           "components": [components[ref] for ref in sorted(components)], "dependencies": dependencies}
    text = json.dumps(bom, indent=1) + "\n"
    if options.out:
        options.out.parent.mkdir(parents=True, exist_ok=True)
        options.out.write_text(text)
    else:
        print(text, end="")


if __name__ == "__main__":
    main()
