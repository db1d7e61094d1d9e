// ViSP's stereo model-based edge tracker, started at a prior pose in each pair.
//
// visp_stereo RANGE LEAST THRESHOLD MU STEP MIN_LENGTH RATIO SCANLINE CALLS… < JOBS
//
// RANGE, THRESHOLD, MU, STEP: settings of the moving edges; the range halves after every call down to LEAST. MIN_LENGTH: shorter
// edges are not tracked (px, 0: all). RATIO: the fraction of good moving edges below which ViSP gives up. SCANLINE: 1 if faces
// hide edges behind them.
// JOBS: a line `fx fy cx cy` of each camera, a line with the 16 numbers of right_from_left, then a line for each attempt:
// left image, right image, model (.cao), 16 numbers of left_from_object at the prior.
// Output: a line for each attempt and number of calls of track(): attempt, calls, 1 if no call gave up, milliseconds of
// the start and of these calls, number of moving edges, 16 numbers of left_from_object.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include <visp3/core/vpConfig.h>
#include <visp3/io/vpImageIo.h>
#include <visp3/mbt/vpMbGenericTracker.h>

static vpHomogeneousMatrix pose(std::istream &in) {
    vpHomogeneousMatrix m;
    for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j) in >> m[i][j];
    return m;
}

static vpCameraParameters camera(std::istream &in) {
    double fx, fy, cx, cy;
    in >> fx >> fy >> cx >> cy;
    vpCameraParameters camera;
    camera.initPersProjWithoutDistortion(fx, fy, cx, cy);
    return camera;
}

static void begin(vpMbGenericTracker &tracker, const vpImage<unsigned char> *images, const vpHomogeneousMatrix &left) {
    tracker.initFromPose(std::map<std::string, const vpImage<unsigned char> *>{{"left", &images[0]}, {"right", &images[1]}},
                         std::map<std::string, vpHomogeneousMatrix>{{"left", left}});
}

int main(int count, char **words) {
    if (count < 10) return 2;
    vpMe me;
    me.setMaskSize(5);
    me.setMaskNumber(180);
    const unsigned widest = std::atoi(words[1]), least = std::atoi(words[2]);
    me.setRange(widest);
    me.setThreshold(std::atof(words[3]));
    me.setMu1(std::atof(words[4]));
    me.setMu2(std::atof(words[4]));
    me.setSampleStep(std::atof(words[5]));
    const double min_length = std::atof(words[6]), ratio = std::atof(words[7]);
    const bool scanline = std::atoi(words[8]) != 0;
    std::vector<int> stops;
    for (int i = 9; i < count; ++i) stops.push_back(std::atoi(words[i]));

    const vpCameraParameters left = camera(std::cin), right = camera(std::cin);
    std::map<std::string, vpHomogeneousMatrix> rig;
    rig["left"].eye();
    rig["right"] = pose(std::cin);

    std::string files[3];
    for (int attempt = 0; std::cin >> files[0] >> files[1] >> files[2]; ++attempt) {
        const vpHomogeneousMatrix prior = pose(std::cin);
        vpImage<unsigned char> images[2];
        vpImageIo::read(images[0], files[0]);
        vpImageIo::read(images[1], files[1]);
        me.setRange(widest);

        vpMbGenericTracker tracker(std::vector<std::string>{"left", "right"},
                                   std::vector<int>{vpMbGenericTracker::EDGE_TRACKER, vpMbGenericTracker::EDGE_TRACKER});
        tracker.setReferenceCameraName("left");
        tracker.setCameraTransformationMatrix(rig);
        tracker.setCameraParameters(std::map<std::string, vpCameraParameters>{{"left", left}, {"right", right}});
        tracker.setMovingEdge(me);
        tracker.setGoodMovingEdgesRatioThreshold(ratio);
        tracker.setAngleAppear(vpMath::rad(88));
        tracker.setAngleDisappear(vpMath::rad(89));
        tracker.setNearClippingDistance(0.1);
        tracker.setFarClippingDistance(100);
        tracker.setClipping(vpPolygon3D::ALL_CLIPPING);
        tracker.setScanLineVisibilityTest(scanline);
        tracker.loadModel(files[2], files[2]);
        if (min_length > 0) {
            // These settings apply to the edges and faces that are already loaded.
            tracker.setLod(true);
            tracker.setMinLineLengthThresh(min_length);
            tracker.setMinPolygonAreaThresh(min_length * min_length);
        }

        const auto start = std::chrono::steady_clock::now();
        bool good = true, started = true;
        try {
            begin(tracker, images, prior);
        } catch (const vpException &) {
            good = started = false;
        }
        int calls = 0;
        for (int stop : stops) {
            for (; started && calls < stop; ++calls) {
                try {
                    const unsigned range = std::max(least, widest >> std::min(calls, 16));
                    if (range < me.getRange()) {
                        // New settings need new edges, started at the pose so far.
                        me.setRange(range);
                        tracker.setMovingEdge(me);
                        vpHomogeneousMatrix here;
                        tracker.getPose(here);
                        begin(tracker, images, here);
                    }
                    tracker.track(images[0], images[1]);
                } catch (const vpException &) {
                    // It stays given up; it has no pose to go on from.
                    good = started = false;
                }
            }
            const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - start;
            vpHomogeneousMatrix found;
            tracker.getPose(found);
            std::printf("%d %d %d %.3f %u", attempt, stop, int(good), took.count(), tracker.getNbFeaturesEdge());
            for (int i = 0; i < 4; ++i)
                for (int j = 0; j < 4; ++j) std::printf(" %.12g", found[i][j]);
            std::printf("\n");
        }
        std::fflush(stdout);
    }
}
