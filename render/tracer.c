// Embree's robust mode: no ray slips between triangles that share an edge. Single precision about the middle of the
// mesh: points nearer than about 1e-7 of its extent cannot be told apart, which is why rays start offset
// (render/patch.h).
// Stops being true for meshes whose extent over detail exceeds 1e6.
#include "render/tracer.h"
#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

static bool count_bytes(void *user, ssize_t bytes, bool post)
{
    (void)post;
    __atomic_add_fetch((int64_t *)user, bytes, __ATOMIC_RELAXED);
    return true;
}

static alb_vector middle_of(const alb_mesh *mesh)
{
    alb_vector low = {INFINITY, INFINITY, INFINITY}, high = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t i = 0; i < mesh->vertex_count; i++) {
        const alb_vector v = mesh->vertices[i];
        low = (alb_vector){fmin(low.x, v.x), fmin(low.y, v.y), fmin(low.z, v.z)};
        high = (alb_vector){fmax(high.x, v.x), fmax(high.y, v.y), fmax(high.z, v.z)};
    }
    return mesh->vertex_count ? alb_times(0.5, alb_add(low, high)) : (alb_vector){0};
}

static bool fill(RTCGeometry geometry, const alb_mesh *mesh, alb_vector middle)
{
    float *vertices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float),
                                              mesh->vertex_count);
    uint32_t *faces = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                              3 * sizeof(uint32_t), mesh->face_count);
    if (!vertices || !faces)
        return false;
    for (size_t i = 0; i < mesh->vertex_count; i++) {
        const alb_vector v = alb_sub(mesh->vertices[i], middle);
        vertices[3 * i] = (float)v.x;
        vertices[3 * i + 1] = (float)v.y;
        vertices[3 * i + 2] = (float)v.z;
    }
    for (size_t i = 0; i < mesh->face_count; i++)
        for (size_t k = 0; k < 3; k++)
            faces[3 * i + k] = mesh->faces[i][k];
    return true;
}

bool alb_tracer_create(alb_tracer *tracer, const alb_mesh *mesh, alb_error *error)
{
    *tracer = (alb_tracer){.middle = middle_of(mesh)};
    RTCDevice device = rtcNewDevice(NULL);
    if (!device) {
        const enum RTCError code = rtcGetDeviceError(NULL);
        return alb_fail(error, code == RTC_ERROR_OUT_OF_MEMORY ? ALB_NO_MEMORY : ALB_INTERNAL,
                        "Embree: cannot start (error %d)", (int)code);
    }
    tracer->device = device;
    rtcSetDeviceMemoryMonitorFunction(device, count_bytes, &tracer->bytes);
    RTCScene scene = rtcNewScene(device);
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    tracer->scene = scene;
    bool ok = scene && geometry && fill(geometry, mesh, tracer->middle);
    if (ok) {
        rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
        rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
        rtcCommitGeometry(geometry);
        rtcAttachGeometry(scene, geometry);
        rtcCommitScene(scene);
    }
    if (geometry)
        rtcReleaseGeometry(geometry);
    const enum RTCError code = rtcGetDeviceError(device);
    if (ok && code == RTC_ERROR_NONE)
        return true;
    alb_tracer_free(tracer);
    return alb_fail(error, code == RTC_ERROR_OUT_OF_MEMORY ? ALB_NO_MEMORY : ALB_INTERNAL,
                    "Embree: cannot build the scene of %zu triangles (error %d)", mesh->face_count, (int)code);
}

void alb_tracer_free(alb_tracer *tracer)
{
    if (tracer->scene)
        rtcReleaseScene(tracer->scene);
    if (tracer->device)
        rtcReleaseDevice(tracer->device);
    *tracer = (alb_tracer){0};
}

static struct RTCRay ray_of(const alb_tracer *tracer, alb_vector from, alb_vector direction, float far)
{
    const alb_vector origin = alb_sub(from, tracer->middle);
    return (struct RTCRay){.org_x = (float)origin.x,
                           .org_y = (float)origin.y,
                           .org_z = (float)origin.z,
                           .dir_x = (float)direction.x,
                           .dir_y = (float)direction.y,
                           .dir_z = (float)direction.z,
                           .tfar = far,
                           .mask = UINT32_MAX};
}

bool alb_tracer_closest(alb_hit *hit, const alb_tracer *tracer, alb_vector origin, alb_vector direction)
{
    struct RTCRayHit ray = {.ray = ray_of(tracer, origin, direction, INFINITY), .hit.geomID = RTC_INVALID_GEOMETRY_ID};
#if RTC_VERSION_MAJOR >= 4
    rtcIntersect1(tracer->scene, &ray, NULL);
#else
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(tracer->scene, &context, &ray);
#endif
    if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID)
        return false;
    const alb_vector normal = {(double)ray.hit.Ng_x, (double)ray.hit.Ng_y, (double)ray.hit.Ng_z};
    *hit = (alb_hit){.face = ray.hit.primID,
                     .front = alb_dot(normal, direction) < 0,
                     .u = (double)ray.hit.u,
                     .v = (double)ray.hit.v,
                     .distance_mm = (double)ray.ray.tfar};
    return true;
}

bool alb_tracer_blocked(const alb_tracer *tracer, alb_vector from, alb_vector to)
{
    // the far end stops short of a surface on which `to` lies
    struct RTCRay ray = ray_of(tracer, from, alb_sub(to, from), 1 - 0x1p-18f);
#if RTC_VERSION_MAJOR >= 4
    rtcOccluded1(tracer->scene, &ray, NULL);
#else
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcOccluded1(tracer->scene, &context, &ray);
#endif
    return ray.tfar < 0;
}
