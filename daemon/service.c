#include "service.h"

#include "clock.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>

struct crm_service {
    pthread_mutex_t lock;
    pthread_cond_t work;
    crm_server *server; /* under the lock, except slices */
    int stop;           /* under the lock */
    int n_workers;
    pthread_t *workers;
};

static double now(void *user)
{
    (void)user;
    return crm_clock_now();
}

static int64_t utime(void *user)
{
    (void)user;
    return crm_clock_utime();
}

static void *work(void *argument)
{
    crm_service *v = argument;
    pthread_mutex_lock(&v->lock);
    while (!v->stop) {
        crm_session *s = crm_server_take(v->server);
        if (!s) {
            pthread_cond_wait(&v->work, &v->lock);
            continue;
        }
        pthread_mutex_unlock(&v->lock);
        crm_session_slice(v->server, s);
        pthread_mutex_lock(&v->lock);
        crm_server_give(v->server, s);
    }
    pthread_mutex_unlock(&v->lock);
    return NULL;
}

static int start_workers(crm_service *v, int n)
{
    v->workers = calloc((size_t)n, sizeof *v->workers);
    while (v->workers && v->n_workers < n) {
        if (pthread_create(&v->workers[v->n_workers], NULL, work, v) != 0) return 0;
        v->n_workers++;
    }
    return v->workers != NULL;
}

crm_service *crm_service_create(const crm_server_settings *settings)
{
    crm_service *v = calloc(1, sizeof *v);
    if (!v) return NULL;
    crm_server_settings set = *settings;
    set.now = now;
    set.utime = utime;
    pthread_mutex_init(&v->lock, NULL);
    pthread_cond_init(&v->work, NULL);
    v->server = crm_server_create(&set);
    if (!v->server || !start_workers(v, set.n_workers)) {
        crm_service_destroy(v);
        return NULL;
    }
    return v;
}

void crm_service_destroy(crm_service *v)
{
    if (!v) return;
    pthread_mutex_lock(&v->lock);
    v->stop = 1;
    pthread_cond_broadcast(&v->work);
    pthread_mutex_unlock(&v->lock);
    for (int i = 0; i < v->n_workers; i++) pthread_join(v->workers[i], NULL);
    crm_server_destroy(v->server);
    pthread_cond_destroy(&v->work);
    pthread_mutex_destroy(&v->lock);
    free(v->workers);
    free(v);
}

void crm_service_receive(crm_service *v, crm_wire_type type, const void *bytes, size_t size)
{
    pthread_mutex_lock(&v->lock);
    crm_server_receive(v->server, type, bytes, size);
    pthread_cond_signal(&v->work);
    pthread_mutex_unlock(&v->lock);
}

void crm_service_refuse_size(crm_service *v, crm_wire_type type, const void *head, size_t n,
                             size_t size)
{
    pthread_mutex_lock(&v->lock);
    crm_server_refuse_size(v->server, type, head, n, size);
    pthread_mutex_unlock(&v->lock);
}

void crm_service_tick(crm_service *v)
{
    pthread_mutex_lock(&v->lock);
    crm_server_tick(v->server);
    pthread_mutex_unlock(&v->lock);
}

void crm_service_status(crm_service *v, crm_transport_figures figures)
{
    pthread_mutex_lock(&v->lock);
    crm_server_status(v->server, figures);
    pthread_mutex_unlock(&v->lock);
}

int64_t crm_service_malformed(crm_service *v, char *why)
{
    const char *text = "";
    pthread_mutex_lock(&v->lock);
    const int64_t n = crm_server_malformed(v->server, &text);
    snprintf(why, 256, "%s", text);
    pthread_mutex_unlock(&v->lock);
    return n;
}
