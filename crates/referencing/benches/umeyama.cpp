// Eigen's umeyama on 3×13 points: nanoseconds per call, minimum of many repetitions.
#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <chrono>
#include <cstdio>

int main() {
    using Points = Eigen::Matrix<double, 3, Eigen::Dynamic>;
    Points seen = Points::Random(3, 13);
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    const Points model = ((turn * seen).colwise() + Eigen::Vector3d(1, 2, 3)) + 0.01 * Points::Random(3, 13);
    double least = 1e9, sum = 0;
    for (int round = 0; round < 400; ++round) {
        const auto start = std::chrono::steady_clock::now();
        for (int i = 0; i < 100; ++i) {
            seen(0, 0) += 1e-12;  // prevents hoisting out of the loop
            sum += Eigen::umeyama(seen, model, false)(0, 3);
        }
        const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
        least = std::min(least, took.count() * 1e9 / 100);
    }
    std::printf("%.1f %g\n", least, sum);
}
