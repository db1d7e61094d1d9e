// A problem as a list of pairs from pairs.py, and the output of every driver: id, ms, answered or not, cloud_from_model.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

struct Pairs {
  std::string id;
  double delta;                     // bound of the difference of two distances, m
  Eigen::Matrix3Xd model, cloud;    // the points of each pair
  std::vector<int> of_model, of_cloud;  // and their indices in the model and the cloud
};

inline Pairs read(const std::string& path) {
  std::ifstream file(path);
  Pairs pairs;
  int count;
  file >> pairs.id >> count >> pairs.delta;
  pairs.model.resize(3, count);
  pairs.cloud.resize(3, count);
  pairs.of_model.resize(count);
  pairs.of_cloud.resize(count);
  for (int k = 0; k < count; k++) {
    for (int axis = 0; axis < 3; axis++) file >> pairs.model(axis, k);
    for (int axis = 0; axis < 3; axis++) file >> pairs.cloud(axis, k);
    file >> pairs.of_model[k] >> pairs.of_cloud[k];
  }
  return pairs;
}

template <class Places>
Eigen::Matrix3Xd chosen(const Eigen::Matrix3Xd& points, const Places& places) {
  Eigen::Matrix3Xd some(3, places.size());
  for (std::size_t k = 0; k < places.size(); k++) some.col(k) = points.col(places[k]);
  return some;
}

template <class Solve>
int run(int count, char** paths, Solve solve) {
  for (int k = 1; k < count; k++) {
    const Pairs pairs = read(paths[k]);
    Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
    const auto start = std::chrono::steady_clock::now();
    const bool answered = pairs.model.cols() >= 3 && solve(pairs, pose);
    const std::chrono::duration<double, std::milli> taken = std::chrono::steady_clock::now() - start;
    std::fprintf(stderr, "%s %.6f %d", pairs.id.c_str(), taken.count(), answered);
    for (int row = 0; row < 4; row++)
      for (int column = 0; column < 4; column++) std::fprintf(stderr, " %.12g", pose(row, column));
    std::fprintf(stderr, "\n");
  }
  return 0;
}
