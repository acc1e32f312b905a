// Vertices of one part: at rest, and what every shape adds to them. Only shapes that are shown cost time, and only at the
// vertices that they move.
import * as THREE from "/three.min.js";

const rows = (attribute, scale) => {
  const out = new Float32Array(3 * attribute.count);
  for (let i = 0; i < attribute.count; i++) for (let k = 0; k < 3; k++) out[3 * i + k] = scale * attribute.getComponent(i, k);
  return out;
};

// Moves of the vertices that a shape moves: their numbers, and six numbers for each (position, normal).
function sparse(moves, turns) {
  const ids = [];
  for (let i = 0; i < moves.length / 3; i++) {
    for (let k = 3 * i; k < 3 * i + 3; k++) if (moves[k] || turns[k]) { ids.push(i); break; }
  }
  const values = new Float32Array(6 * ids.length);
  ids.forEach((id, j) => { for (let k = 0; k < 3; k++) { values[6 * j + k] = moves[3 * id + k]; values[6 * j + 3 + k] = turns[3 * id + k]; } });
  return { ids: Uint32Array.from(ids), values };
}

export class Part {
  // mesh: of the file, in whole steps. step, middle: take them to metres. breath: the name of the shape that shaders show.
  constructor(mesh, step, middle, breath) {
    const { geometry } = mesh, { position, normal, skinWeight, skinIndex } = geometry.attributes;
    this.rest = rows(position, step);
    for (let i = 0; i < this.rest.length; i++) this.rest[i] += middle[i % 3];
    this.restNormal = rows(normal, 1);
    this.geometry = new THREE.BufferGeometry();
    this.geometry.setIndex(geometry.index);
    for (const name of ["uv", "color", "_visible", "_skin"]) if (geometry.attributes[name]) this.geometry.setAttribute(name, geometry.attributes[name]);
    this.position = this.#moving("position", this.rest);
    this.normal = this.#moving("normal", this.restNormal);
    if (skinWeight) {
      const share = Float32Array.from({ length: position.count }, (_, i) => (skinIndex.getX(i) === 1 ? skinWeight.getX(i) : 0));
      this.geometry.setAttribute("share", new THREE.BufferAttribute(share, 1));
    }
    const moves = (i) => [rows(geometry.morphAttributes.position[i], step), rows(geometry.morphAttributes.normal[i], 1)];
    const { [breath]: breathing, ...others } = mesh.morphTargetDictionary ?? {};
    this.breathes = breathing !== undefined;
    if (this.breathes) ["breath", "breath_normal"].forEach((name, i) => this.geometry.setAttribute(name, new THREE.BufferAttribute(moves(breathing)[i], 3)));
    this.shapes = Object.entries(others).map(([name, i]) => ({ name, weight: 0, ...sparse(...moves(i)) }));
  }

  #moving(name, values) {
    const attribute = new THREE.BufferAttribute(values.slice(), 3);
    attribute.setUsage(THREE.DynamicDrawUsage);
    this.geometry.setAttribute(name, attribute);
    return attribute;
  }

  // Shows shapes by weight; returns whether anything moved.
  show(weights) {
    let changed = false;
    for (const shape of this.shapes) {
      const weight = weights[shape.name] ?? 0;
      changed ||= weight !== shape.weight;
      shape.weight = weight;
    }
    if (!changed) return false;
    const at = this.position.array, normals = this.normal.array;
    at.set(this.rest);
    normals.set(this.restNormal);
    for (const { ids, values, weight } of this.shapes) {
      if (weight) for (let j = 0, k = 0; j < ids.length; j++, k += 6) {
        const i = 3 * ids[j];
        at[i] += weight * values[k]; at[i + 1] += weight * values[k + 1]; at[i + 2] += weight * values[k + 2];
        normals[i] += weight * values[k + 3]; normals[i + 1] += weight * values[k + 4]; normals[i + 2] += weight * values[k + 5];
      }
    }
    this.position.needsUpdate = this.normal.needsUpdate = true;
    return true;
  }
}
