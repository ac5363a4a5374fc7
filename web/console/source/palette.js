// SPDX-License-Identifier: Apache-2.0
// Colour-blind safe palette of robots and subtasks.

const COLOURS = ["#1f6fb4", "#d8731a", "#2a8c4a", "#8a4fb0", "#b0344c", "#6b6f1c", "#147f86"];

export const colour = (number) => COLOURS[number % COLOURS.length];
