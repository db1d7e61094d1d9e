// TEASER++'s solver without scale, with its clique or without.
#pragma once

#include "common.h"
#include "teaser/registration.h"

using Teaser = teaser::RobustRegistrationSolver;

inline bool graduated(const Eigen::Matrix3Xd& model, const Eigen::Matrix3Xd& cloud, double delta,
                      Teaser::INLIER_SELECTION_MODE mode, Eigen::Matrix4d& pose) {
  Teaser::Params params;
  params.noise_bound = delta / 2;
  params.cbar2 = 1;
  params.estimate_scaling = false;
  params.rotation_max_iterations = 100;
  params.rotation_gnc_factor = 1.4;
  params.rotation_cost_threshold = 0.005;
  params.max_clique_num_threads = 1;
  params.inlier_selection_mode = mode;
  Teaser solver(params);
  solver.solve(model, cloud);
  const auto found = solver.getSolution();
  pose.topLeftCorner<3, 3>() = found.rotation;
  pose.topRightCorner<3, 1>() = found.translation;
  return found.valid && (mode == Teaser::INLIER_SELECTION_MODE::NONE || solver.getInlierMaxClique().size() >= 3);
}
