// Parameters of a face as weights of its shapes and angles of its eyes and head: as surface/head/model/parameters.py.
const HEAD_DEG = [60, 40, 30], EYE_DEG = [35, 30], RAD = Math.PI / 180;
const TONGUE_NEEDS = 0.33, TONGUE_FIRST = 1.7, LID_SHARE = 0.72, GIVE_WAY = 0.75, GIVEN = 0.5;
const BELOW = ["mouthRollLower", "mouthShrugLower", "mouthPressLeft", "mouthPressRight"];
const clamp = (x, low, high) => Math.min(Math.max(x, low), high);

function lidDown(look, blink) {
  if (look <= 0 || blink <= 0) return look;
  const width = blink * (1 - blink), apart = Math.abs(LID_SHARE * look - blink);
  const smooth = width > 0 ? Math.max(width - apart, 0) ** 2 / (4 * width) : 0;
  return (Math.max(LID_SHARE * look - blink, 0) + smooth) / LID_SHARE;
}

function look(at, side, sign) {
  const eye = side.toLowerCase();
  const yaw = clamp((at[`${eye}EyeYaw`] ?? 0) + (at[`eyeLookOut${side}`] - at[`eyeLookIn${side}`]) * sign, -1, 1);
  const pitch = clamp((at[`${eye}EyePitch`] ?? 0) + at[`eyeLookDown${side}`] - at[`eyeLookUp${side}`], -1, 1);
  const out = yaw * sign, blink = at[`eyeBlink${side}`];
  at[`eyeLookDown${side}`] = lidDown(Math.max(pitch, 0), blink);
  at[`eyeLookUp${side}`] = Math.max(-pitch, 0) * (1 - blink);
  at[`eyeLookIn${side}`] = Math.max(-out, 0);
  at[`eyeLookOut${side}`] = Math.max(out, 0);
  at[`eyeWide${side}`] *= 1 - blink;
  return [yaw * EYE_DEG[0] * RAD, pitch * EYE_DEG[1] * RAD];
}

// How much of a user's own groups is shown: the value of the parameter, times those that it names, 0 to 1.
// own: { name: [names that it is multiplied by] }.
export function ownAmounts(names, values, own) {
  const at = {}, amounts = {};
  names.forEach((name, i) => { at[name] = clamp(values[i], -1, 1); });
  for (const [name, times] of Object.entries(own)) amounts[name] = times.reduce((amount, each) => amount * clamp(at[each] ?? 0, 0, 1), at[name] ?? 0);
  return amounts;
}

// names, values: of the parameters. Returns { weights by shape, eyes: [yaw, pitch] left and right, head: yaw, pitch, roll }.
export function readPose(names, values) {
  const at = {};
  names.forEach((name, i) => { at[name] = clamp(values[i], -1, 1); });
  const needed = TONGUE_NEEDS * Math.min(1, TONGUE_FIRST * at.tongueOut);
  at.jawOpen = Math.max(at.jawOpen, needed);
  const left = 1 - GIVE_WAY * Math.min(1, at.tongueOut / GIVEN);
  for (const name of BELOW) at[name] *= left;
  const eyes = [look(at, "Left", 1), look(at, "Right", -1)];
  at.mouthClose = Math.min(at.mouthClose, at.jawOpen - needed);
  const head = ["headYaw", "headPitch", "headRoll"].map((name, i) => (at[name] ?? 0) * HEAD_DEG[i] * RAD);
  return { weights: at, eyes, head };
}

// How far lips are apart, mm, where they are furthest apart. weights: of shapes. lips: { shape: mm in each of some columns
// at weight 1 }, those of an own group at weight -1 under "-shape".
export function lipsApart(weights, lips) {
  const apart = [];
  for (const [name, mm] of Object.entries(lips)) {
    const weight = name.startsWith("-") ? -(weights[name.slice(1)] ?? 0) : weights[name] ?? 0;
    if (weight > 0) mm.forEach((each, i) => { apart[i] = (apart[i] ?? 0) + weight * each; });
  }
  return Math.max(0, ...apart);
}
