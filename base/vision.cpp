// The bridge to OpenCV: translation only. No exception leaves it.
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/quality/qualityssim.hpp>
#include <string>
#include <sys/mman.h>
#include <unistd.h>
#include <vector>

extern "C" {
#include "base/memory.h"
#include "base/vision.h"
}

namespace
{
// Runs `work`; an exception becomes an error with the name of what was being done.
template <typename Work> bool guarded(const char *name, alb_error *error, Work work) noexcept
{
    try {
        static const bool quiet = [] {
            cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
            cv::setNumThreads(1); // calibrateCamera's threads add up the views as they finish: other sums each time
            cv::redirectError([](int, const char *, const char *, const char *, int, void *) { return 0; });
            return true;
        }();
        (void)quiet;
        return work();
    } catch (const cv::Exception &problem) {
        return alb_fail(error, ALB_BAD_DATA, "%s: %s", name, problem.err.c_str());
    } catch (const std::bad_alloc &) {
        return alb_fail(error, ALB_NO_MEMORY, "%s: out of memory", name);
    } catch (...) {
        return alb_fail(error, ALB_INTERNAL, "%s: unexpected failure in OpenCV", name);
    }
}

// Decodes with standard error caught: libpng and libjpeg print what is wrong there and may still return half a picture.
// `complaint` becomes the first line that tells of damage, or stays empty.
cv::Mat decode_quietly(const cv::Mat &data, std::string &complaint)
{
    static std::mutex one_at_a_time;
    const std::lock_guard<std::mutex> lock(one_at_a_time);
    const int kept = dup(STDERR_FILENO), caught = memfd_create("stderr", MFD_CLOEXEC);
    cv::Mat picture;
    if (kept >= 0 && caught >= 0)
        dup2(caught, STDERR_FILENO);
    try {
        picture = cv::imdecode(data, cv::IMREAD_ANYDEPTH | cv::IMREAD_ANYCOLOR);
    } catch (const cv::Exception &problem) {
        complaint = problem.err;
    }
    if (kept >= 0 && caught >= 0) {
        dup2(kept, STDERR_FILENO);
        char text[2048] = "";
        const ssize_t size = pread(caught, text, sizeof text - 1, 0);
        for (const char *sign : {"libpng error: ", "Premature end", "Corrupt JPEG", "TIFFRead", "TIFFFill"}) {
            const char *at = size > 0 ? std::strstr(text, sign) : nullptr;
            if (at && complaint.empty())
                complaint = std::string(at, std::strcspn(at, "\n"));
        }
    }
    for (const int descriptor : {kept, caught})
        if (descriptor >= 0)
            close(descriptor);
    return picture;
}

cv::Mat matrix(const alb_lens &l) { return (cv::Mat_<double>(3, 3) << l.fx, 0, l.cx, 0, l.fy, l.cy, 0, 0, 1); }

cv::Mat distortion(const alb_lens &l) { return (cv::Mat_<double>(1, 5) << l.k1, l.k2, l.p1, l.p2, l.k3); }

// camera_from_board from a rotation vector and a translation.
alb_transform transform(const cv::Mat &rotation, const cv::Mat &translation)
{
    cv::Mat r, v, t;
    rotation.convertTo(v, CV_64F);
    translation.convertTo(t, CV_64F);
    cv::Rodrigues(v, r);
    alb_transform result;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            result.rotation[i][j] = r.at<double>(i, j);
    result.translation = {t.at<double>(0), t.at<double>(1), t.at<double>(2)};
    return result;
}

std::vector<cv::Point2f> pixels(const double *corners, int points)
{
    std::vector<cv::Point2f> result;
    for (int i = 0; i < points; i++)
        result.emplace_back(static_cast<float>(corners[2 * i]), static_cast<float>(corners[2 * i + 1]));
    return result;
}

std::vector<cv::Point3f> plane(const double *board, int points)
{
    std::vector<cv::Point3f> result;
    for (int i = 0; i < points; i++)
        result.emplace_back(static_cast<float>(board[2 * i]), static_cast<float>(board[2 * i + 1]), 0.0F);
    return result;
}

double rms(const std::vector<cv::Point2f> &a, const std::vector<cv::Point2f> &b)
{
    double sum = 0;
    for (size_t i = 0; i < a.size(); i++)
        sum += std::pow(static_cast<double>(a[i].x - b[i].x), 2) + std::pow(static_cast<double>(a[i].y - b[i].y), 2);
    return std::sqrt(sum / static_cast<double>(a.size()));
}
// cornerSubPix in a window that stays clear of the neighbouring corners: a third of the smallest spacing, 11 px at
// most.
void refine(const cv::Mat &picture, std::vector<cv::Point2f> &points, int columns)
{
    const size_t row = static_cast<size_t>(columns);
    double spacing = 1e9;
    for (size_t i = 1; i < points.size(); i++) {
        if (i % row)
            spacing = std::min(spacing, cv::norm(points[i] - points[i - 1]));
        if (i >= row)
            spacing = std::min(spacing, cv::norm(points[i] - points[i - row]));
    }
    const int half = std::max(2, std::min(11, static_cast<int>(spacing * 0.36)));
    cv::cornerSubPix(picture, points, cv::Size(half, half), cv::Size(-1, -1),
                     cv::TermCriteria(cv::TermCriteria::EPS + cv::TermCriteria::MAX_ITER, 50, 1e-4));
}
} // namespace

extern "C" bool alb_vision_decode(alb_image *image, int *bits, const void *bytes, size_t size, const char *name,
                                  alb_error *error)
{
    *image = alb_image();
    return guarded(name, error, [&] {
        const cv::Mat data(1, static_cast<int>(size), CV_8U, const_cast<void *>(bytes));
        std::string complaint;
        cv::Mat picture = decode_quietly(data, complaint);
        if (picture.empty() || !complaint.empty())
            return alb_fail(error, ALB_BAD_DATA, "%s: not a readable image (EXR, PNG, TIFF, JPEG, PFM or HDR)%s%s",
                            name, complaint.empty() ? "" : ": ", complaint.c_str());
        const int depth = picture.depth(), channels = picture.channels();
        if ((depth != CV_8U && depth != CV_16U && depth != CV_32F) || (channels != 1 && channels != 3))
            return alb_fail(error, ALB_BAD_DATA, "%s: an image of this depth or number of channels is not read", name);
        *bits = depth == CV_8U ? 8 : depth == CV_16U ? 16 : 0;
        if (channels == 3)
            cv::cvtColor(picture, picture, cv::COLOR_BGR2RGB);
        picture.convertTo(picture, CV_32F);
        if (!alb_image_create(image, picture.cols, picture.rows, channels == 3 ? "R,G,B" : "Y", error))
            return false;
        for (int y = 0; y < picture.rows; y++)
            std::memcpy(alb_image_at(image, 0, y), picture.ptr<float>(y),
                        sizeof(float) * static_cast<size_t>(picture.cols) * static_cast<size_t>(channels));
        return true;
    });
}

extern "C" bool alb_vision_encode_png(unsigned char **bytes, size_t *size, const void *samples, int width, int height,
                                      int channels, int bytes_per_sample, alb_error *error)
{
    return guarded("PNG", error, [&] {
        const int type = CV_MAKETYPE(bytes_per_sample == 2 ? CV_16U : CV_8U, channels);
        cv::Mat picture(height, width, type, const_cast<void *>(samples)), bgr;
        if (channels == 3)
            cv::cvtColor(picture, bgr, cv::COLOR_RGB2BGR);
        std::vector<unsigned char> png;
        if (!cv::imencode(".png", channels == 3 ? bgr : picture, png))
            return alb_fail(error, ALB_INTERNAL, "PNG: the picture of %d x %d cannot be encoded", width, height);
        *bytes = static_cast<unsigned char *>(alb_allocate(png.size(), 1, error));
        if (!*bytes)
            return false;
        std::memcpy(*bytes, png.data(), png.size());
        *size = png.size();
        return true;
    });
}

extern "C" bool alb_vision_chessboard(double *corners, bool *found, const alb_image *grey, int columns, int rows,
                                      alb_error *error)
{
    *found = false;
    return guarded("chessboard", error, [&] {
        cv::Mat values(grey->height, grey->width, CV_32F, grey->pixels), picture;
        double low = 0, high = 0;
        cv::minMaxLoc(values, &low, &high);
        if (!(high > low) || !std::isfinite(low) || !std::isfinite(high))
            return true; // a flat image shows no board
        values.convertTo(picture, CV_8U, 255 / (high - low), -255 * low / (high - low));
        std::vector<cv::Point2f> points;
        const cv::Size size(columns, rows);
        *found =
            cv::findChessboardCornersSB(picture, size, points, cv::CALIB_CB_ACCURACY | cv::CALIB_CB_NORMALIZE_IMAGE);
        if (!*found)
            *found = cv::findChessboardCorners(picture, size, points);
        if (*found)
            refine(picture, points, columns);
        *found = *found && points.size() == static_cast<size_t>(columns) * static_cast<size_t>(rows);
        for (size_t i = 0; *found && i < points.size(); i++) {
            corners[2 * i] = static_cast<double>(points[i].x);
            corners[2 * i + 1] = static_cast<double>(points[i].y);
        }
        return true;
    });
}

extern "C" bool alb_vision_calibrate(alb_lens_estimate *estimate, alb_transform *poses, double *view_rms_px,
                                     const double *corners, const double *board, int views, int points, int width,
                                     int height, int terms, alb_error *error)
{
    *estimate = alb_lens_estimate();
    return guarded("lens calibration", error, [&] {
        std::vector<std::vector<cv::Point2f>> seen;
        const std::vector<std::vector<cv::Point3f>> known(static_cast<size_t>(views), plane(board, points));
        for (int v = 0; v < views; v++)
            seen.push_back(pixels(corners + 2 * v * points, points));
        cv::Mat k, d, sd_lens, sd_pose, errors;
        std::vector<cv::Mat> rotations, translations;
        const int fixed = (terms < 2 ? cv::CALIB_FIX_K2 : 0) | (terms < 4 ? cv::CALIB_ZERO_TANGENT_DIST : 0) |
                          (terms < 5 ? cv::CALIB_FIX_K3 : 0);
        estimate->rms_px = cv::calibrateCamera(known, seen, cv::Size(width, height), k, d, rotations, translations,
                                               sd_lens, sd_pose, errors, fixed);
        estimate->lens = {width,
                          height,
                          k.at<double>(0, 0),
                          k.at<double>(1, 1),
                          k.at<double>(0, 2),
                          k.at<double>(1, 2),
                          d.at<double>(0),
                          d.at<double>(1),
                          d.at<double>(2),
                          d.at<double>(3),
                          d.at<double>(4)};
        for (int i = 0; i < 9; i++)
            estimate->sd[i] = sd_lens.at<double>(i);
        for (int v = 0; v < views; v++) {
            poses[v] = transform(rotations[static_cast<size_t>(v)], translations[static_cast<size_t>(v)]);
            view_rms_px[v] = errors.at<double>(v);
        }
        return true;
    });
}

extern "C" bool alb_vision_pose(alb_transform *pose, double *rms_px, const double *corners, const double *board,
                                int points, const alb_lens *lens, alb_error *error)
{
    return guarded("board pose", error, [&] {
        const auto known = plane(board, points);
        const auto seen = pixels(corners, points);
        cv::Mat rotation, translation;
        if (!cv::solvePnP(known, seen, matrix(*lens), distortion(*lens), rotation, translation, false,
                          cv::SOLVEPNP_IPPE))
            return alb_fail(error, ALB_BAD_DATA, "board pose: no pose explains the corners");
        cv::solvePnPRefineLM(known, seen, matrix(*lens), distortion(*lens), rotation, translation);
        std::vector<cv::Point2f> projected;
        cv::projectPoints(known, rotation, translation, matrix(*lens), distortion(*lens), projected);
        *rms_px = rms(projected, seen);
        *pose = transform(rotation, translation);
        return true;
    });
}

extern "C" bool alb_vision_ssim(double ssim[ALB_CHANNELS_MAX], const alb_image *a, const alb_image *b, double peak,
                                alb_error *error)
{
    return guarded("SSIM", error, [&] {
        for (int c = 0; c < a->channels; c++) { // OpenCV's constants assume values in 0..255
            cv::Mat planes[2];
            const alb_image *images[2] = {a, b};
            for (int i = 0; i < 2; i++) {
                const cv::Mat all(images[i]->height, images[i]->width, CV_32FC(images[i]->channels), images[i]->pixels);
                cv::extractChannel(all, planes[i], c);
                planes[i] *= 255 / peak;
            }
            ssim[c] = cv::quality::QualitySSIM::compute(planes[0], planes[1], cv::noArray())[0];
        }
        return true;
    });
}
