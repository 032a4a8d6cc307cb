// Requests for images, and for values of their pixels.

#include <time.h>

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "image/flip.h"
#include "image/metrics.h"
#include "render/aov.h"
#include "studio/api.h"
#include "studio/image_reply.h"
#include "studio/pixel_values.h"
#include "studio/reply_json.h"
#include "studio/request_values.h"
#include "studio/scene_data.h"

namespace etendue {
namespace {

using nlohmann::json;

double thread_cpu_seconds() {
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

/// An image of a run of a scene that was loaded before may have another size than the page expects.
void check_size(int width, int height, const FilmGeometry& film) {
    if (width != film.crop_width || height != film.crop_height)
        throw ApiError(409, "the run belongs to a scene of another size");
}

/// The image of a view such as technique:connect-2-3.
const std::vector<Rgb>& technique_image(const TechniqueSnapshot& shown, const std::string& view) {
    const std::string key = view.substr(view.find(':') + 1);
    for (const TechniqueImages::Entry& e : shown.images)
        if (key_of(e.technique) == key)
            return view.starts_with("technique:") ? e.weighted : e.unweighted;
    throw ApiError(404, "there is no such technique");
}

/// The sum of the images of techniques whose paths have so many edges.
std::vector<Rgb> length_image(const TechniqueSnapshot& shown, const std::string& view) {
    const int edges = integer_of(view.substr(view.find(':') + 1), "length");
    std::vector<Rgb> sum(size_t(shown.width) * size_t(shown.height));
    for (const TechniqueImages::Entry& e : shown.images)
        if (e.technique.vertices() - 1 == edges)
            for (size_t i = 0; i < sum.size(); ++i) sum[i] += e.weighted[i];
    return sum;
}

}  // namespace

template <class Make>
void Api::send(const Done& done, const Make& make) {
    later(image_workers_, done, [this, make] {
        const double before = thread_cpu_seconds();
        Reply reply = Reply::binary(make());
        session_.spent(thread_cpu_seconds() - before);
        return reply;
    });
}

std::string Api::reference_problem() const {
    const auto scene = session_.scene();
    if (!options_.reference || !scene) return {};
    const FilmGeometry& g = scene->film();
    if (options_.reference->width == g.crop_width && options_.reference->height == g.crop_height)
        return {};
    return fmt::format("the reference has {} × {} pixels, but the image {} × {}",
                       options_.reference->width, options_.reference->height, g.crop_width,
                       g.crop_height);
}

void Api::image(const Request& request, const Done& done) {
    // The budget of snapshots includes all that this thread does, so what it did since the last image.
    const double cpu = thread_cpu_seconds();
    if (charged_ > 0 && cpu > charged_) session_.spent(cpu - charged_);
    charged_ = cpu;

    const std::shared_ptr<SceneData> data = this->data();
    const FilmGeometry& g = data->scene()->film();
    ImagePart part;
    part.level = query_integer(request, "level", 0);
    if (const auto rect = request.query("rect")) {
        part.rect = rect_of(*rect);
        check(*part.rect, g.crop_width, g.crop_height);
    }
    const std::string view = request.query("view").value_or("image");
    if (view == "first")
        return send(done, [data] {
            const FirstPicture& p = data->first_picture();
            return encode_image({}, PixelRows<Rgb>(p.pixels, p.width, p.height));
        });
    if (view == "reference") {
        if (!options_.reference) throw ApiError(404, "there is no reference");
        if (const std::string problem = reference_problem(); !problem.empty())
            throw ApiError(409, problem);
        return send(done, [this, part] {
            const RgbImage& r = *options_.reference;
            return encode_image(part, PixelRows<Rgb>(r.pixels, r.width, r.height));
        });
    }
    if (const auto opened = opened_.of_view(view)) {
        const Snapshot& p = *opened->pixels;
        if (p.width != g.crop_width || p.height != g.crop_height)
            throw ApiError(409,
                           fmt::format("{} has {} × {} pixels, but the image {} × {}", opened->file,
                                       p.width, p.height, g.crop_width, g.crop_height));
        part.passes = p.passes;
        return send(done, [pixels = opened->pixels, part] {
            return encode_image(part, PixelRows<Rgb>(pixels->mean, pixels->width, pixels->height));
        });
    }
    for (const AovInfo& a : aov_registry())
        if (view == a.name && view != "variance")
            return later(workers_, done, [data, part, view] {
                const FilmGeometry& film = data->scene()->film();
                return Reply::binary(encode_image(
                    part, PixelRows<Rgb>(data->layer(view), film.crop_width, film.crop_height)));
            });

    const int id = query_integer(request, "run", 0);
    const auto after = uint64_t(query_integer(request, "after", 0));
    part.run = uint32_t(id);
    const bool is_length = view.starts_with("length:");
    if (is_length || view.starts_with("technique:") || view.starts_with("unweighted:")) {
        const auto shown = session_.techniques(id);
        if (!shown || shown->passes <= after) return done(Reply::nothing());
        check_size(shown->width, shown->height, g);
        part.passes = shown->passes;
        return send(done, [shown, part, view, is_length] {
            const std::vector<Rgb> sum =
                is_length ? length_image(*shown, view) : std::vector<Rgb>();
            return encode_image(part,
                                PixelRows<Rgb>(is_length ? sum : technique_image(*shown, view),
                                               shown->width, shown->height));
        });
    }
    if (view == "denoised") {
        const FilmGeometry& of_run = session_.scene_of(id)->film();
        check_size(of_run.crop_width, of_run.crop_height, g);
        const auto shown = denoised_.ask(id, after);
        if (!shown || shown->passes <= after) return done(Reply::nothing());
        part.passes = shown->passes;
        return send(done, [shown, part] {
            return encode_image(part, PixelRows<Rgb>(shown->mean, shown->width, shown->height));
        });
    }
    if (view != "image" && view != "variance" && view != "error")
        throw ApiError(404, fmt::format("there is no view \"{}\"", view));
    const auto shown = session_.snapshot(id);
    if (!shown || shown->passes <= after) return done(Reply::nothing());
    check_size(shown->width, shown->height, g);
    part.passes = shown->passes;
    send(done, [shown, part, view] {
        if (view == "error")
            return encode_image(
                part, PixelRows<float>(relative_errors(*shown), shown->width, shown->height));
        return encode_image(part, PixelRows<Rgb>(view == "image" ? shown->mean : shown->variance,
                                                 shown->width, shown->height));
    });
}

std::shared_ptr<const Snapshot> Api::shown(const std::string& run_or_view) {
    if (const auto opened = opened_.of_view(run_or_view)) return opened->pixels;
    if (const auto run = DenoisedImages::run_of(run_or_view)) return denoised_.of_run(*run);
    return session_.snapshot(integer_of(run_or_view, "run"));
}

void Api::images(Request request, const Done& done) {
    if (request.method == "DELETE") {
        opened_.remove(query_integer(request, "image", 0));
        return done(Reply::json("{}"));
    }
    if (request.method != "POST") throw ApiError(405, "this method is not possible here");
    const std::string file = request.query("file").value_or("");
    if (file.empty()) throw ApiError(422, "\"file\", the name of the file, is missing");
    later(workers_, done, [this, file, bytes = std::move(request.body)]() mutable {
        return Reply::json(dump({{"image", opened_.add(opened_image(std::move(bytes), file))}}));
    });
}

Reply Api::pixel(const Request& request) {
    const int x = query_integer(request, "x", -1), y = query_integer(request, "y", -1),
              w = query_integer(request, "w", 1), h = query_integer(request, "h", 1);
    const std::string view = request.query("view").value_or("");
    const auto opened = opened_.of_view(view);
    const std::optional<int> denoised = DenoisedImages::run_of(view);
    const int id = opened ? 0 : denoised ? *denoised : query_integer(request, "run", 0);
    const auto snapshot = opened     ? opened->pixels
                          : denoised ? denoised_.of_run(id)
                                     : session_.snapshot(id);
    if (!snapshot) return Reply::json(dump({{"run", id}, {"passes", 0}}));
    check({x, y, w, h}, snapshot->width, snapshot->height);
    const IntervalKind interval = opened     ? opened->interval
                                  : denoised ? IntervalKind::None
                                             : session_.status(id).interval;
    const RectangleValues values = values_in(*snapshot, {x, y, w, h});
    json j{{"run", id},           {"passes", snapshot->passes},
           {"mean", values.mean}, {"interval", to_string(interval)},
           {"half", nullptr},     {"pixels", int64_t(w) * int64_t(h)},
           {"nan", values.nan},   {"infinite", values.infinite}};
    if (values.finite > 1) {
        j["least"] = values.least;
        j["largest"] = values.largest;
        j["variance"] = values.variance;
    }
    if (snapshot->passes >= 2 && interval != IntervalKind::None && values.finite > 0) {
        for (size_t c = 0; c < 3; ++c)
            j["half"][c] = interval_half_width(values.squared_error[c], snapshot->passes);
    }
    if (options_.reference && options_.reference->width == snapshot->width &&
        options_.reference->height == snapshot->height) {
        std::array<double, 3> value{};
        for_each_pixel({x, y, w, h}, snapshot->width, [&](size_t i) {
            for (int c = 0; c < 3; ++c)
                value[size_t(c)] +=
                    double(options_.reference->pixels[i][c]) / (double(w) * double(h));
        });
        j["reference"] = value;
    }
    return Reply::json(dump(j));
}

void Api::worst(const Request& request, const Done& done) {
    const int id = query_integer(request, "run", 0);
    const int width = session_.scene_of(id)->film().crop_width;
    const uint64_t pixels = session_.scene_of(id)->film().pixel_count();
    const auto to_json = [width](const WorstPixel& w) {
        return json{{"x", w.pixel % uint64_t(width)},
                    {"y", w.pixel / uint64_t(width)},
                    {"pass", w.pass},
                    {"value", w.value},
                    {"share", w.share}};
    };
    if (request.query("x")) {
        const int x = query_integer(request, "x", 0), y = query_integer(request, "y", 0);
        check({x, y, 1, 1}, width, int(pixels / uint64_t(width)));
        const uint64_t pixel = uint64_t(y) * uint64_t(width) + uint64_t(x);
        return session_.ask_largest(id, [pixel, to_json, done](const LargestPasses& largest) {
            const auto found = largest.at(pixel);
            done(Reply::json(
                dump({{"passes", largest.passes()}, {"pixel", found ? to_json(*found) : json()}})));
        });
    }
    constexpr int kMost = 1000;
    const int count = query_integer(request, "count", 20);
    if (count < 1 || count > kMost)
        throw ApiError(422, fmt::format("\"count\" must be from 1 to {}", kMost));
    session_.ask_largest(id, [count, to_json, done](const LargestPasses& largest) {
        json list = json::array();
        for (const WorstPixel& w : largest.worst(size_t(count))) list.push_back(to_json(w));
        done(Reply::json(dump({{"passes", largest.passes()}, {"pixels", list}})));
    });
}

void Api::difference(const Request& request, const Done& done) {
    const auto snapshot = shown(request.query("run").value_or("0"));
    const std::string against = request.query("against").value_or("0");
    std::shared_ptr<const Snapshot> other;
    if (against != "reference")
        other = shown(against);
    else if (!options_.reference)
        throw ApiError(404, "there is no reference");
    if (!snapshot || (against != "reference" && !other))
        throw ApiError(422, "one of the images has no finished pass yet");
    const std::span<const Rgb> reference = other ? other->mean : options_.reference->pixels;
    const int width = other ? other->width : options_.reference->width;
    if (width != snapshot->width || reference.size() != snapshot->mean.size())
        throw ApiError(409, "the images differ in size");
    const auto opened = opened_.of_view(against);
    if (DenoisedImages::run_of(against) || (opened && opened->is_denoised))
        throw ApiError(422, "a denoised image is biased, so nothing is measured against it");
    later(workers_, done, [snapshot, other, reference] {
        const ImageErrors errors = image_errors(snapshot->mean, reference);
        const FlipResult flip =
            hdr_flip(snapshot->mean, reference, snapshot->width, snapshot->height);
        return Reply::json(dump({{"rel_mse", errors.rel_mse},
                                 {"not_finite", errors.not_finite},
                                 {"flip", flip.mean},
                                 {"passes", snapshot->passes},
                                 {"against_passes", other ? other->passes : 0}}));
    });
}

void Api::gain(const Request& request, const Done& done) {
    const auto without = session_.seed_series(query_integer(request, "without", 0)),
               with = session_.seed_series(query_integer(request, "with", 0));
    later(workers_, done, [without, with] {
        const SeedComparison c = compare(*without, *with);
        json j{{"without", to_json(c.a, *without)},
               {"with", to_json(c.b, *with)},
               {"means_differ", c.means_differ}};
        if (c.is_valid) j["ratio"] = c.ratio, j["gain"] = {c.gain, c.low, c.high};
        return Reply::json(dump(j));
    });
}

Reply Api::techniques(const Request& request) {
    const auto shown = session_.techniques(query_integer(request, "run", 0));
    json list = json::array();
    if (shown)
        for (size_t i = 0; i < shown->images.size(); ++i) {
            json item = to_json(shown->images[i].technique);
            double sum = 0;
            for (const Rgb c : shown->images[i].weighted) sum += double(luminance(c));
            item["key"] = key_of(shown->images[i].technique);
            item["mean"] = sum / double(shown->images[i].weighted.size());
            list.push_back(std::move(item));
        }
    return Reply::json(dump({{"passes", shown ? shown->passes : 0}, {"techniques", list}}));
}

}  // namespace etendue
